"""Figures of the maps' training objective, of one run and of several."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rbpf_svgp_slam.figures import figure_style as style
from rbpf_svgp_slam.figures.track_figures import Drawn
from rbpf_svgp_slam.metrics.evaluation import Evaluation
from rbpf_svgp_slam.run.survey_run import SurveyRun

Curves = "dict[str, tuple[np.ndarray, np.ndarray]]"
_OBJECTIVE_LABEL = "−ELBO per beam (nats)"


def elbo(run: SurveyRun, evaluation: Evaluation) -> Drawn:
    """Draw the training objective of particle 0's map, and below it the beams in the log.

    None where the run has not recorded it.
    """
    history = run.status_history
    objective = -np.asarray(history.get("elbo", ()), dtype=float)
    if not np.isfinite(objective).any() or not len(run.stamp_s):
        return None
    minutes = style.minutes_since_start(run, history["t_s"])
    beams = np.asarray(history.get("beams", ()), dtype=float)
    heights = [3.2, 1] if len(beams) else [3.2]
    figure = Figure(figsize=(style.WIDTH_IN, sum(heights)))
    panels = figure.subplots(
        len(heights), sharex=True, squeeze=False, gridspec_kw={"height_ratios": heights}
    )[:, 0]
    draw_objectives(panels[0], {"": (minutes, objective)})
    panels[0].set(title="Training objective of one particle's map")
    caption = (
        "Negative evidence lower bound per beam of particle 0's map, a moving average, over the "
        "survey: it falls while the map learns and rises where new relief comes in. Values above "
        "the axis, as before the first training, are cut off."
    )
    if len(beams):
        panels[1].fill_between(minutes, beams / 1000, color="#9aa5b1", alpha=0.5, linewidth=0)
        panels[1].set(ylabel="beams (1000)", ylim=(0, None))
        panels[1].locator_params(axis="y", nbins=3)
        caption += " Below: the beams in the log."
    panels[-1].set(xlabel="time (min)")
    figure.align_ylabels()
    return figure, caption


def objective_curves(curves: Curves) -> tuple[Figure, str]:
    """Draw the training objectives of several runs into one figure; returns its caption too.

    curves: by label, minutes [n] of the survey and −ELBO [n] per beam in nats, NaN where unknown.
    """
    with matplotlib.rc_context(style.STYLE):
        figure = Figure(figsize=(style.WIDTH_IN, 3.8))
        axes = figure.add_subplot()
        draw_objectives(axes, curves)
        axes.set(xlabel="time (min)", title="Training objective of one particle's map")
        axes.legend(loc="upper right")
    return figure, (
        "Negative evidence lower bound per beam of one particle's map, a moving average, over the "
        "survey, for each run. Values above the axis, as before the first training, are cut off."
    )


def draw_objectives(axes: Axes, curves: Curves) -> None:
    """Draw curves, as for objective_curves(), with limits that show the bumps of new relief."""
    # Runs that differ in nothing that their maps depend on lie upon one another: dashes show both.
    coloured = zip(curves.items(), style.CURVE_COLOURS)
    for k, ((label, (minutes, objective)), colour) in enumerate(coloured):
        line = {"color": colour, "linestyle": "-" if k < 3 else (0, (4, 4))}
        axes.plot(minutes, objective, label=label, linewidth=1.2, **line)
    axes.set(ylabel=_OBJECTIVE_LABEL, ylim=objective_limits([y for _, y in curves.values()]))


def objective_limits(objectives: list[np.ndarray]) -> tuple[float, float] | None:
    """Return the axis' limits, nats, for arrays [n]; None, matplotlib's own, without values.

    A map that has just begun to learn is worse by orders of magnitude.
    """
    known = [y[np.isfinite(y)] for y in (np.asarray(y, dtype=float) for y in objectives)]
    spans = np.array([np.percentile(y, [0, 50, 97, 100]) for y in known if y.size])
    if not spans.size:
        return None
    lowest, median, usual, highest = spans.T
    low, high = lowest.min(), np.minimum(highest, median + 3 * (usual - median)).max()
    margin = 0.06 * (high - low) or 0.5
    return low - margin, high + margin
