"""Figures of the trajectories, and of the filter's history.

Each function returns a figure and its caption, or None where the run has no data for it.
"""

from __future__ import annotations

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rbpf_svgp_slam.charts.charted_seabed import masked_map
from rbpf_svgp_slam.figures import figure_style as style
from rbpf_svgp_slam.figures.chart_marks import draw_north_arrow, draw_scale_bar
from rbpf_svgp_slam.metrics.evaluation import Evaluation
from rbpf_svgp_slam.nested import flatten
from rbpf_svgp_slam.run.survey_run import SurveyRun

Drawn = "tuple[Figure, str] | None"
# Series of the status history, in the order of the panels: name, axis label, drawn as steps.
_HISTORY_PANELS = (
    ("n_eff", "$N_\\mathrm{eff}$", False),
    ("loop_closure_prompts", "prompts", True),
    ("resamplings", "resamplings", True),
    ("iterations_total", "iterations (1000)", False),
    ("ready_maps", "maps ready", True),
    ("tau", "τ", False),
)


def trajectories(run: SurveyRun, evaluation: Evaluation) -> Drawn:
    """Draw all trajectories over the seabed; where there is none, over the best particle's map."""
    if not len(run.stamp_s):
        return None
    figure, [[axes]] = style.map_subplots(run, 1)
    grid, ground = run.seabed, " over the seabed"
    if grid is None:
        grid, ground = masked_map(run), " over the best particle's map"
    if grid is None:
        ground = ""
    else:
        style.draw_depths(axes, grid.x, grid.y, grid.mean, run)
    draw_track(axes, "dead_reckoning", run.dead_reckoning)
    draw_track(axes, "estimate", run.estimate)
    if run.ground_truth is not None:
        draw_track(axes, "ground_truth", run.ground_truth)
    mark_start_and_end(axes, run.estimate)
    style.map_axes(axes, f"Trajectories{ground}")
    draw_scale_bar(axes)
    on_earth = bool(run.config.get("survey_origin"))
    if on_earth:
        draw_north_arrow(axes)
    style.legend_below(axes)
    frame = "x to the east and y to the north" if on_earth else "which is local"
    return figure, f"Trajectories{ground} in the map frame, {frame}."


def draw_track(axes: Axes, name: str, poses: np.ndarray) -> None:
    """Draw the way of poses [P, 6], m, map frame, named as in figure_style.LABELS, with a halo."""
    line = {"color": style.COLOURS[name], "label": style.LABELS[name]}
    width = 1.5
    if name == "ground_truth":
        # Thin and broken: a good estimate would hide it, or be hidden.
        width = 0.9
        line["linestyle"] = (0, (5, 3))
    halo = [patheffects.withStroke(linewidth=width + 1.6, foreground="white", alpha=0.8)]
    axes.plot(*poses[:, :2].T, linewidth=width, path_effects=halo, **line)


def mark_start_and_end(axes: Axes, poses: np.ndarray) -> None:
    """Mark where the known ones of poses [P, 6], m, map frame, begin and end."""
    known = poses[np.isfinite(poses[:, :2]).all(axis=1), :2]
    marks = {"linestyle": "", "markeredgecolor": "white", "zorder": 4}
    # The start is larger: a survey that ends where it began would hide it.
    axes.plot(*known[:1].T, "o", color=style.START_COLOUR, label="start", markersize=12, **marks)
    axes.plot(*known[-1:].T, "s", color="black", label="end", markersize=7, **marks)


def event_minutes(run: SurveyRun, counter: str) -> np.ndarray:
    """Return when a counter of the status history grew: minutes [n] since the first ping.

    It grew between two statuses; the later one counts. What the first status already holds
    happened at a time that nobody recorded.
    """
    history = run.status_history
    counted = np.asarray(history.get(counter, ()), dtype=float)
    t_s = np.asarray(history.get("t_s", ()), dtype=float)
    if not len(run.stamp_s) or len(counted) != len(t_s):
        return np.empty(0)
    return style.minutes_since_start(run, t_s[1:][np.diff(counted) > 0])


def _mark_resamplings(run: SurveyRun, axes: Axes) -> None:
    """Draw a short tick at each, hanging from the top, where it hides no curve."""
    instants = event_minutes(run, "resamplings")
    if not len(instants):
        return
    ticks = {"linestyle": "", "marker": 3, "markersize": 5, "markeredgewidth": 0.9}
    from_top = axes.get_xaxis_transform()
    axes.plot(
        instants,
        np.ones(len(instants)),
        color=style.RESAMPLING_COLOUR,
        label="resamplings",
        transform=from_top,
        clip_on=False,
        **ticks,
    )


def filter_history(run: SurveyRun, evaluation: Evaluation) -> Drawn:
    """Draw what the filter did over time, one panel per recorded series."""
    history = run.status_history
    # A run of mapping only has prompted nothing: no τ.
    panels = [p for p in _HISTORY_PANELS if np.isfinite(history.get(p[0], np.nan)).any()]
    if not panels or not len(history.get("t_s", ())) or not len(run.stamp_s):
        return None
    figure = Figure(figsize=(style.WIDTH_IN, 0.7 + 1.15 * len(panels)))
    minutes = style.minutes_since_start(run, history["t_s"])
    all_axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (name, label, is_step) in zip(all_axes, panels):
        values = np.asarray(history[name], dtype=float)
        values = values / 1000 if name == "iterations_total" else values
        drawstyle = "steps-post" if is_step else "default"
        axes.plot(minutes, values, color=style.COLOURS["estimate"], drawstyle=drawstyle)
        axes.set(ylabel=label)
        axes.locator_params(axis="y", nbins=4)
        if name == "n_eff":
            _mark_threshold(run, axes)
    all_axes[0].set(title="The filter over time")
    all_axes[-1].set(xlabel="time (min)")
    figure.align_ylabels()
    share = _resampling_threshold(run)
    threshold = f" and the threshold below which they happen, {share:g} J" if share else ""
    return figure, (
        f"Effective number of particles with the instants of resampling{threshold}, the running "
        "totals of loop-closure prompts, resamplings and optimizer steps, how many maps were ready "
        "for prompts, and the tempering τ of the last prompt's likelihood."
    )


def _resampling_threshold(run: SurveyRun) -> float | None:
    """The run's resampling/threshold, a share of J; none where either of them is not known."""
    share = dict(flatten(run.config)).get("resampling/threshold")
    known = isinstance(share, (int, float)) and run.statistics.get("particles")
    return float(share) if known else None


def _mark_threshold(run: SurveyRun, axes: Axes) -> None:
    """Mark the resamplings and the threshold below which they happen, where it is known."""
    axes.set_ylim(0, None)
    share = _resampling_threshold(run)
    if share:
        threshold = {"color": "#555555", "linestyle": "--", "linewidth": 0.9}
        below = share * run.statistics["particles"]
        axes.axhline(below, label=f"threshold {share:g} J", **threshold)
    _mark_resamplings(run, axes)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(**style.LEGEND_ABOVE)
