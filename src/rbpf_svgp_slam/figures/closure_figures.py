"""Figure of the loop closures over the survey.

The function returns a figure and its caption, or None where the run has no data for it.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap
from matplotlib.lines import Line2D

from rbpf_svgp_slam.figures import figure_style as style
from rbpf_svgp_slam.figures.track_figures import Drawn
from rbpf_svgp_slam.metrics.closure_metrics import GAP_S, WRONG_ABOVE, closure_errors
from rbpf_svgp_slam.metrics.evaluation import Evaluation
from rbpf_svgp_slam.run.survey_run import SurveyRun
from rbpf_svgp_slam.run.tracks import interpolate_poses

_TRACK_COLOUR, _WRONG_COLOUR = "#6b7785", "#CC0000"
# One colour, so that only the relief is seen, and the lines upon it.
_GROUND = ListedColormap(["#f0f2f4"])
# What keeps its colour in all reports; other verdicts take those that are left.
_VERDICT_COLOURS = {
    "flat": "#009E73",
    "ambiguous": "#CC79A7",
    "bad_fit": "#E69F00",
    "little_overlap": "#D55E00",
}


def loop_closures(run: SurveyRun, evaluation: Evaluation) -> Drawn:
    """Draw the closures as lines between the poses of the final estimate that they tie together."""
    lines = _lines(run)
    drawn = np.isfinite(lines).all(axis=(1, 2))
    if not drawn.any():
        return None
    closures = run.closures
    figure, [[axes]] = style.map_subplots(run, 1)
    if run.seabed is not None:
        grid = run.seabed
        ground = {"cmap": _GROUND, "interpolation": "bilinear", "relief": True}
        style.draw_grid(axes, grid.x, grid.y, grid.mean, **ground)
    axes.plot(*run.estimate[:, :2].T, color=_TRACK_COLOUR, linewidth=0.8, label="track", zorder=1)
    for verdict, colour in _refused(run).items():
        which = drawn & (closures.verdict == verdict)
        look = {"colors": colour, "linewidths": 0.7, "linestyles": [(0, (4, 3))], "zorder": 2}
        axes.add_collection(LineCollection(lines[which], **look))
    accepted = drawn & closures.accepted
    if accepted.any():
        _draw_accepted(run, axes, lines[accepted], accepted)
    wrong = _draw_wrong(run, axes, lines)
    style.map_axes(axes, "Loop closures")
    _legend(run, axes, wrong)
    return figure, (
        "Loop closures as lines between the middles of the two windows of pings that each ties "
        "together, on the final track over the seabed's relief. Accepted ones by their residual, "
        "the horizontal distance by which the final trajectory departs from what the closure has "
        "measured; refused ones dashed, by the reason. Red crosses, where there is ground truth: "
        "accepted ones whose error is beyond 3 of their own σ."
    )


def _lines(run: SurveyRun) -> np.ndarray:
    """Ends [C, 2, 2] of the closures on the final track, m; NaN where that is not known."""
    if run.closures is None:
        return np.empty((0, 2, 2))
    known = np.isfinite(run.estimate).all(axis=1)
    ends = [
        interpolate_poses(run.stamp_s[known], run.estimate[known], stamp, GAP_S)[:, :2]
        for stamp in (run.closures.stamp_older, run.closures.stamp)
    ]
    return np.stack(ends, axis=1)


def _draw_accepted(run: SurveyRun, axes: Axes, lines: np.ndarray, accepted: np.ndarray) -> None:
    """Draw lines [n, 2, 2], those of the closures chosen [C], coloured by their residuals."""
    error, _ = closure_errors(run.closures, run.stamp_s, run.estimate)
    residual_m = np.hypot(*error[accepted, :2].T)
    collection = LineCollection(lines, cmap=style.LINE_MAP, linewidths=1.6, zorder=3)
    collection.set_array(np.ma.array(residual_m))
    collection.set_clim(0, max(np.percentile(residual_m, 99), 1e-3))
    axes.add_collection(collection)
    style.colour_bar(collection, "residual of accepted closures (m)")


def _draw_wrong(run: SurveyRun, axes: Axes, lines: np.ndarray) -> int:
    """Mark the accepted closures that ground truth says are wrong; returns how many there are."""
    if run.ground_truth is None:
        return 0
    _, squares = closure_errors(run.closures, run.stamp_s, run.ground_truth)
    wrong = run.closures.accepted & (squares > WRONG_ABOVE)
    middles = lines[wrong].mean(axis=1)
    axes.plot(*middles.T, "x", color=_WRONG_COLOUR, markersize=6, markeredgewidth=1.6, zorder=4)
    return int(wrong.sum())


def _refused(run: SurveyRun) -> dict[str, str]:
    """The verdicts that refused a closure, the most frequent first, and their colours."""
    counts = Counter(run.closures.verdict[~run.closures.accepted].tolist())
    left = (c for c in style.CURVE_COLOURS if c not in _VERDICT_COLOURS.values())
    return {
        name: _VERDICT_COLOURS.get(name) or next(left, "black") for name, _ in counts.most_common()
    }


def _legend(run: SurveyRun, axes: Axes, wrong: int) -> None:
    """Say how many there are of each kind."""
    counts = Counter(run.closures.verdict.tolist())
    accepted = int(run.closures.accepted.sum())
    shade = style.LINE_MAP(0.6)
    axes.plot([], [], color=shade, linewidth=1.6, label=f"accepted ({accepted})")
    for verdict, colour in _refused(run).items():
        label = f"{verdict.replace('_', ' ')} ({counts[verdict]})"
        axes.plot([], [], color=colour, linewidth=0.9, linestyle=(0, (4, 3)), label=label)
    if wrong:
        marks = {"linestyle": "", "marker": "x", "color": _WRONG_COLOUR, "markeredgewidth": 1.6}
        axes.add_line(Line2D([], [], label=f"wrong ({wrong})", **marks))
    style.legend_below(axes)
