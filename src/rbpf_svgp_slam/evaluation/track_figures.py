"""Figures of the trajectories, their errors, and the filter's history.

Each function returns a figure and its caption, or None where the run has no data for it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from . import figure_style as style
from .survey_run import SurveyRun
from .trajectory import position_error

if TYPE_CHECKING:
    from .report import Evaluation

Drawn = "tuple[Figure, str] | None"
# Series of the status history, in the order of the panels: name, axis label, drawn as steps.
_HISTORY_PANELS = (
    ("n_eff", "$N_\\mathrm{eff}$", False),
    ("loop_closure_prompts", "prompts", True),
    ("resamplings", "resamplings", True),
    ("iterations_total", "iterations (1000)", False),
    ("ready_maps", "maps ready", True),
    ("tau", "τ", False),
    ("elbo", "ELBO per beam", False),
)


def trajectories(run: SurveyRun, evaluation: Evaluation) -> Drawn:
    """Draw all trajectories over the map's mean."""
    if not len(run.stamp_s):
        return None
    width = 0.8 * style.WIDTH_IN
    figure = Figure(figsize=(width, min(0.9 * width * style.plan_aspect(run) + 0.8, 9)))
    axes = figure.add_subplot()
    grid = run.map
    limits = style.colour_limits(grid.mean)
    mesh = style.draw_grid(axes, grid.x, grid.y, grid.mean, cmap="Greys_r", alpha=0.55, **limits)
    style.colour_bar(figure, mesh, axes, style.DEPTH_LABEL)
    halo = [patheffects.withStroke(linewidth=3.2, foreground="white")]
    for name in ("dead_reckoning", "estimate"):
        line = {"color": style.COLOURS[name], "label": style.LABELS[name]}
        poses = getattr(run, name)
        axes.plot(*poses[:, :2].T, path_effects=halo, **line)
        axes.plot(*poses[-1, :2], "s", color=style.COLOURS[name], mec="white", ms=7, zorder=4)
    if run.ground_truth is not None:
        # Thin and last: a good estimate would hide it.
        line = {"color": style.COLOURS["ground_truth"], "label": style.LABELS["ground_truth"]}
        axes.plot(*run.ground_truth[:, :2].T, linestyle=(0, (5, 3)), linewidth=0.9, **line)
    axes.plot(*run.estimate[0, :2], "o", color="#009E73", mec="white", ms=9, label="start")
    axes.plot([], [], "s", color="#7f7f7f", mec="white", ms=7, label="ends")
    style.map_axes(axes, "Trajectories over the map's mean depth")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncol=5)
    return figure, "Trajectories in the map frame over the mean of the estimated seabed."


def position_errors(run: SurveyRun, evaluation: Evaluation) -> Drawn:
    """Draw the errors over time; without ground truth, what the filter corrected."""
    if not len(run.stamp_s):
        return None
    truth = run.ground_truth
    if truth is None or not np.isfinite(truth).any():
        return _corrections(run)
    figure = Figure(figsize=(style.WIDTH_IN, 5.6))
    panels = figure.subplots(3, 1, sharex=True)
    minutes = style.minutes_since_start(run, run.stamp_s)
    for name in ("dead_reckoning", "estimate"):
        error = position_error(getattr(run, name), truth)
        line = {"color": style.COLOURS[name], "label": style.LABELS[name]}
        panels[0].plot(minutes, np.linalg.norm(error, axis=1), **line)
        for axes, component in zip(panels[1:], error.T):
            axes.plot(minutes, component, **line)
    panels[0].set(ylabel="error (m)", title="Position error", ylim=(0, None))
    panels[1].set(ylabel="error in x (m)")
    panels[2].set(ylabel="error in y (m)", xlabel="time (min)")
    _draw_spread(run, panels[1:], minutes)
    panels[0].legend(*panels[1].get_legend_handles_labels(), **style.LEGEND_ABOVE)
    figure.align_ylabels()
    return figure, (
        "Position error against ground truth over time: the 3-D distance, and its components in "
        "x and y with the spread of the particles (±2σ)."
    )


def _draw_spread(run: SurveyRun, panels: list[Axes], minutes: np.ndarray) -> None:
    """Draw ±2σ about zero into the panels of x and y."""
    for axes, axis in zip(panels, range(2)):
        axes.axhline(0, color="#555555", linewidth=0.7)
        if run.estimate_std_m is not None:
            band = 2 * run.estimate_std_m[:, axis]
            colour = style.COLOURS["estimate"]
            axes.fill_between(
                minutes, -band, band, color=colour, alpha=0.18, lw=0, label="±2σ of particles"
            )


def _corrections(run: SurveyRun) -> Drawn:
    """Draw estimate minus dead reckoning, which needs no ground truth."""
    figure = Figure(figsize=(style.WIDTH_IN, 3.8))
    panels = figure.subplots(2, 1, sharex=True)
    minutes = style.minutes_since_start(run, run.stamp_s)
    shift = position_error(run.estimate, run.dead_reckoning)
    for axes, component, label in zip(panels, shift.T, "xy"):
        axes.plot(minutes, component, color=style.COLOURS["estimate"], label="correction")
        axes.set(ylabel=f"correction in {label} (m)")
    _draw_spread(run, panels, minutes)
    panels[0].set(title="Correction of dead reckoning")
    panels[0].legend(**style.LEGEND_ABOVE)
    panels[1].set(xlabel="time (min)")
    return figure, (
        "RBPF minus dead reckoning over time, with the spread of the particles (±2σ about zero); "
        "errors are unknown without ground truth."
    )


def filter_history(run: SurveyRun, evaluation: Evaluation) -> Drawn:
    """Draw what the filter did over time, one panel per recorded series."""
    history = run.status_history
    panels = [panel for panel in _HISTORY_PANELS if len(history.get(panel[0], ()))]
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
            _mark_resampling(run, axes, minutes)
    all_axes[0].set(title="The filter over time")
    all_axes[-1].set(xlabel="time (min)")
    figure.align_ylabels()
    return figure, (
        "Effective number of particles with the instants of resampling, and the running totals of "
        "loop-closure prompts, resamplings and optimizer steps."
    )


def _mark_resampling(run: SurveyRun, axes: Axes, minutes: np.ndarray) -> None:
    """Mark the instants of resampling and the threshold J/2."""
    axes.set_ylim(0, None)
    particles = run.statistics.get("particles")
    if particles:
        threshold = {"color": "#555555", "linestyle": "--", "linewidth": 0.9}
        axes.axhline(particles / 2, label="threshold J/2", **threshold)
    counted = np.asarray(run.status_history.get("resamplings", ()), dtype=float)
    instants = minutes[1:][np.diff(counted) > 0] if len(counted) == len(minutes) else []
    for i, instant in enumerate(instants):
        label = "resampling" if i == 0 else None
        axes.axvline(instant, color=style.COLOURS["dead_reckoning"], linewidth=0.8, label=label)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(**style.LEGEND_ABOVE)
