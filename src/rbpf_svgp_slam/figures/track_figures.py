"""Figures of the trajectories, their errors, and the filter's history.

Each function returns a figure and its caption, or None where the run has no data for it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import ScaledTranslation

from rbpf_svgp_slam.figures import figure_style as style
from rbpf_svgp_slam.metrics.evaluation import Evaluation
from rbpf_svgp_slam.metrics.trajectory_errors import position_error
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
    grid, ground = run.seabed, "the seabed"
    if grid is None:
        grid, ground = run.map, "the best particle's map"
    if grid.mean.size:
        limits = style.colour_limits(grid.mean)
        depth = {"cmap": style.DEPTH_MAP, "interpolation": "bilinear", "relief": True, **limits}
        image = style.draw_grid(axes, grid.x, grid.y, grid.mean, **depth)
        style.colour_bar(image, style.DEPTH_LABEL)
    draw_track(axes, "dead_reckoning", run.dead_reckoning)
    draw_track(axes, "estimate", run.estimate)
    if run.ground_truth is not None:
        draw_track(axes, "ground_truth", run.ground_truth)
    mark_start_and_end(axes, run.estimate)
    style.map_axes(axes, f"Trajectories over {ground}")
    style.legend_below(axes)
    return figure, f"Trajectories in the map frame over {ground}."


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


def position_errors(run: SurveyRun, evaluation: Evaluation) -> Drawn:
    """Draw the errors over time; without ground truth, what the filter corrected."""
    if len(run.stamp_s) < 2:
        return None
    truth = run.ground_truth
    if truth is None or not np.isfinite(truth).any():
        return _corrections(run)
    figure = Figure(figsize=(style.WIDTH_IN, 5.9))
    panels = figure.subplots(3, 1, sharex=True)
    minutes = style.minutes_since_start(run, run.stamp_s)
    for name in ("dead_reckoning", "online", "estimate"):
        if getattr(run, name) is None:
            continue
        error = position_error(getattr(run, name), truth)
        line = {"color": style.COLOURS[name], "label": style.LABELS[name]}
        panels[0].plot(minutes, np.linalg.norm(error, axis=1), **line)
        for axes, component in zip(panels[1:], error.T):
            axes.plot(minutes, component, **line)
    panels[0].set(ylabel="error (m)", title="Position error", ylim=(0, None))
    panels[1].set(ylabel="error in x (m)")
    panels[2].set(ylabel="error in y (m)", xlabel="time (min)")
    _draw_spread(run, panels[1:], minutes)
    _mark_events(run, panels)
    panels[0].legend(*panels[-1].get_legend_handles_labels(), **style.LEGEND_ABOVE)
    figure.align_ylabels()
    return figure, (
        "Position error against ground truth over time: the 3-D distance, and its components in "
        "x and y with what the estimates say of their own errors (±2σ about zero), which is "
        "nothing where all particles descend from one. RBPF online: the estimate when a ping came; "
        "RBPF: as the whole survey has it. Ticks: loop-closure prompts that changed the weights; "
        "vertical lines: resamplings."
    )


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


def _mark_events(run: SurveyRun, panels: Sequence[Axes]) -> None:
    """Mark resamplings through all panels and prompts along the foot of each."""
    prompts = event_minutes(run, "loop_closure_prompts")
    ticks = {"linestyle": "", "marker": "|", "markersize": 6, "markeredgewidth": 0.6}
    for axes in panels:
        _mark_resamplings(run, axes)
        if len(prompts):
            above_foot = ScaledTranslation(0, 4 / 72, axes.figure.dpi_scale_trans)
            axes.plot(
                prompts,
                np.zeros(len(prompts)),
                color=style.PROMPT_COLOUR,
                label="prompts",
                transform=axes.get_xaxis_transform() + above_foot,
                **ticks,
            )


def _mark_resamplings(run: SurveyRun, axes: Axes) -> None:
    """Draw a light line at each; the more there are, the lighter, so that curves stay readable."""
    instants = event_minutes(run, "resamplings")
    if not len(instants):
        return
    line = {"color": style.RESAMPLING_COLOUR, "linewidth": 0.8, "zorder": 0.5}
    opacity = float(np.clip(40 / len(instants), 0.15, 0.8))
    foot_to_top = axes.get_xaxis_transform()
    axes.vlines(instants, 0, 1, transform=foot_to_top, alpha=opacity, **line)
    axes.plot([], [], label="resamplings", **line)


def _draw_spread(run: SurveyRun, panels: Sequence[Axes], minutes: np.ndarray) -> None:
    """Draw both estimates' ±2σ about zero into the panels of x and y."""
    covariances = {"online": run.online_covariance, "estimate": run.estimate_covariance}
    for axes, variance in zip(panels, (0, 3)):  # xx and yy in a row
        axes.axhline(0, color="#555555", linewidth=0.7)
        for name, covariance in covariances.items():
            if covariance is None:
                continue
            band = 2 * np.sqrt(np.maximum(covariance[:, variance], 0))
            fill = {"color": style.COLOURS[name], "alpha": 0.22, "lw": 0}
            axes.fill_between(minutes, -band, band, label=f"±2σ, {style.LABELS[name]}", **fill)


def _corrections(run: SurveyRun) -> Drawn:
    """Draw estimate minus dead reckoning, which needs no ground truth."""
    figure = Figure(figsize=(style.WIDTH_IN, 4.0))
    panels = figure.subplots(2, 1, sharex=True)
    minutes = style.minutes_since_start(run, run.stamp_s)
    for name in ("online", "estimate"):
        if getattr(run, name) is None:
            continue
        line = {"color": style.COLOURS[name], "label": style.LABELS[name]}
        shift = position_error(getattr(run, name), run.dead_reckoning)
        for axes, component in zip(panels, shift.T):
            axes.plot(minutes, component, **line)
    for axes, label in zip(panels, "xy"):
        axes.set(ylabel=f"correction in {label} (m)")
    _draw_spread(run, panels, minutes)
    _mark_events(run, panels)
    panels[0].set(title="Correction of dead reckoning")
    panels[0].legend(**style.LEGEND_ABOVE)
    panels[1].set(xlabel="time (min)")
    return figure, (
        "RBPF minus dead reckoning over time, online and as the whole survey has it, with what the "
        "estimates say of their own errors (±2σ about zero), loop-closure prompts (ticks) and "
        "resamplings (vertical lines); errors are unknown without ground truth."
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
