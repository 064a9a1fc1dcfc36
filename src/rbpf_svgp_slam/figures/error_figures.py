"""Figures of the position errors over time, and of what the estimates say of them.

Each function returns a figure and its caption, or None where the run has no data for it.
"""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from rbpf_svgp_slam.figures import figure_style as style
from rbpf_svgp_slam.figures.track_figures import Drawn, event_minutes
from rbpf_svgp_slam.metrics.evaluation import Evaluation
from rbpf_svgp_slam.metrics.trajectory_errors import position_error
from rbpf_svgp_slam.run.survey_run import SurveyRun

_EVENTS = {
    "loop_closure_prompts": ("prompts", style.PROMPT_COLOUR),
    "resamplings": ("resamplings", style.RESAMPLING_COLOUR),
}
# A logarithm of an error that is zero, as at a known start, would stretch the axis without end.
_LEAST_ERROR_M = 0.01
# Of the errors and of 2σ; single pings above it are cut off.
_SHOWN_PERCENT = 99.5


def position_errors(run: SurveyRun, evaluation: Evaluation) -> Drawn:
    """Draw the errors over time; without ground truth, what the filter corrected."""
    if len(run.stamp_s) < 2:
        return None
    truth = run.ground_truth
    if truth is None or not np.isfinite(truth).any():
        return _corrections(run)
    names = _estimates(run)
    events = _events(run)
    figure, top, rest = _layout(run, 2, len(names), 3.0)
    for name in ("dead_reckoning", *names):
        error = position_error(getattr(run, name), truth)
        distance_m = np.maximum(np.linalg.norm(error, axis=1), _LEAST_ERROR_M)
        _draw_curve(top, run, name, distance_m)
    # The last, the best: its smallest errors of single pings may leave the picture.
    top.set_ylim(0.8 * np.nanpercentile(distance_m, 2) or None, None)
    top.set(ylabel="distance (m)", title="Position error", yscale="log")
    top.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    top.yaxis.set_major_formatter("{x:g}")
    top.yaxis.set_minor_locator(NullLocator())
    for panels, name in zip(rest.T, names):
        error = position_error(getattr(run, name), truth)
        for axes, component in zip(panels, error.T):
            _draw_curve(axes, run, name, component)
        _draw_spread(run, panels, name)
        panels[0].set(title=style.LABELS[name])
    for axes, label in zip(rest[:, 0], "xy"):
        axes.set(ylabel=f"error in {label} (m)")
    _finish(figure, top, rest)
    return figure, (
        "Position error against ground truth over time. Above: the 3-D distance, on a logarithmic "
        f"scale{_told(events)}. Below, on scales of their own: its components in x and y, and the "
        "±2σ that the estimate itself gives for them, within which 95 % should lie; it is nothing "
        "where all particles descend from one. RBPF online: the estimate when a ping came; RBPF: "
        "as the whole survey has it."
    )


def _corrections(run: SurveyRun) -> Drawn:
    """Draw estimate minus dead reckoning, which needs no ground truth, and 2σ."""
    names = _estimates(run)
    events = _events(run)
    covariances = {name: getattr(run, f"{name}_covariance") for name in names}
    has_spread = any(covariance is not None for covariance in covariances.values())
    figure, top, rest = _layout(run, 2 if has_spread else 1, 1, 1.6)
    for name in names:
        shift = position_error(getattr(run, name), run.dead_reckoning)
        for axes, component in zip((top, rest[0, 0]), shift.T):
            _draw_curve(axes, run, name, component)
        if covariances[name] is not None:
            _draw_curve(rest[1, 0], run, name, 2 * _largest_std_m(covariances[name]))
    top.set(ylabel="in x (m)", title="Correction of dead reckoning")
    rest[0, 0].set(ylabel="in y (m)")
    if has_spread:
        rest[1, 0].set(ylabel="2σ (m)", ylim=(0, None))
    _finish(figure, top, rest)
    spread = ", and 2σ of their own errors along the longest axis of the ellipse" * has_spread
    return figure, (
        "RBPF minus dead reckoning over time, online and as the whole survey has it"
        f"{spread}{_told(events)}. Errors are unknown without ground truth."
    )


def _estimates(run: SurveyRun) -> list[str]:
    """Names of the run's estimates."""
    return [name for name in ("online", "estimate") if getattr(run, name) is not None]


def _events(run: SurveyRun) -> dict[str, np.ndarray]:
    """Instants [n] of each counter that grew, minutes since the first ping."""
    instants = {counter: event_minutes(run, counter) for counter in _EVENTS}
    return {counter: minutes for counter, minutes in instants.items() if len(minutes)}


def _told(events: dict[str, np.ndarray]) -> str:
    """What the strip of events shows, for a caption."""
    if not events:
        return ""
    return ", with the loop-closure prompts that changed the weights, and the resamplings, below it"


def _layout(
    run: SurveyRun, rows: int, columns: int, top_height_in: float
) -> tuple[Figure, Axes, np.ndarray]:
    """Return a figure, its upper axes over the whole width, and rows × columns of axes below.

    Between them stands a strip of events, where there are any: drawn through the curves, hundreds
    of them would hide these.
    """
    events = _events(run)
    strip_in = [0.17 * len(events)] if events else []
    heights = [top_height_in, *strip_in, *[1.6] * rows]
    figure = Figure(figsize=(style.WIDTH_IN, sum(heights) + 0.9))
    grid = figure.add_gridspec(len(heights), columns, height_ratios=heights)
    top = figure.add_subplot(grid[0, :])
    if events:
        _draw_events(figure.add_subplot(grid[1, :], sharex=top), events)
    rest = np.empty((rows, columns), dtype=object)
    first_row = len(heights) - rows
    for row, column in np.ndindex(rows, columns):
        shared = {"sharex": top, "sharey": rest[0, column] if columns > 1 and row else None}
        rest[row, column] = figure.add_subplot(grid[first_row + row, column], **shared)
    return figure, top, rest


def _draw_events(axes: Axes, events: dict[str, np.ndarray]) -> None:
    """Draw a row of ticks for each kind."""
    for row, (counter, minutes) in enumerate(events.items()):
        label, colour = _EVENTS[counter]
        ticks = {"linestyle": "", "marker": "|", "markersize": 8, "markeredgewidth": 0.8}
        axes.plot(minutes, np.full(len(minutes), row), color=colour, label=label, **ticks)
    labels = [f"{_EVENTS[counter][0]} ({len(minutes)})" for counter, minutes in events.items()]
    axes.set_yticks(range(len(events)), labels)
    axes.set(ylim=(len(events) - 0.4, -0.6))
    axes.grid(False)
    axes.tick_params(length=0, labelbottom=False)
    axes.spines[["left", "bottom"]].set_visible(False)


def _draw_curve(axes: Axes, run: SurveyRun, name: str, values: np.ndarray) -> None:
    minutes = style.minutes_since_start(run, run.stamp_s)
    line = {"color": style.COLOURS[name], "label": style.LABELS[name]}
    axes.plot(minutes, values, linewidth=1.2, **line)


def _draw_spread(run: SurveyRun, panels: np.ndarray, name: str) -> None:
    """Draw an estimate's ±2σ about zero into its panels of x and y, and scale these to show it."""
    minutes = style.minutes_since_start(run, run.stamp_s)
    covariance = getattr(run, f"{name}_covariance")
    shown = [np.abs(axes.lines[0].get_ydata()) for axes in panels]
    for axes, variance in zip(panels, (0, 3)):  # xx and yy in a row
        axes.axhline(0, color="#555555", linewidth=0.7)
        if covariance is None:
            continue
        band = 2 * np.sqrt(np.maximum(covariance[:, variance], 0))
        fill = {"facecolor": style.COLOURS[name], "alpha": 0.25, "linewidth": 0}
        axes.fill_between(minutes, -band, band, label=f"±2σ, {style.LABELS[name]}", **fill)
        for edge in (-band, band):
            axes.plot(minutes, edge, color=style.COLOURS[name], linewidth=0.6, alpha=0.8)
        shown.append(band)
    shown = np.concatenate(shown)
    shown = shown[np.isfinite(shown)]
    if len(shown):
        reach_m = 1.1 * max(np.percentile(shown, _SHOWN_PERCENT), _LEAST_ERROR_M)
        panels[0].set_ylim(-reach_m, reach_m)


def _largest_std_m(covariance: np.ndarray) -> np.ndarray:
    """Standard deviation [P] along the longest axis of the ellipse of x and y, of covariances
    [P, 6]."""
    xx, xy, _, yy, *_ = covariance.T
    # The larger eigenvalue of [[xx, xy], [xy, yy]].
    largest = (xx + yy) / 2 + np.hypot((xx - yy) / 2, xy)
    return np.sqrt(np.maximum(largest, 0))


def _finish(figure: Figure, top: Axes, rest: np.ndarray) -> None:
    """Time below the lowest panels alone, and one legend above all."""
    for axes in (top, *rest[:-1].flat):
        axes.tick_params(labelbottom=False)
    for axes in rest[-1]:
        axes.set(xlabel="time (min)")
    handles, labels = top.get_legend_handles_labels()
    for axes in rest[-1]:
        for handle, label in zip(*axes.get_legend_handles_labels()):
            if label not in labels:
                handles.append(handle)
                labels.append(label)
    top.legend(handles, labels, **style.LEGEND_ABOVE)
