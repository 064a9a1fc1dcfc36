"""Figures of the seabed maps, their residuals, and the survey's consistency.

Each function returns a figure and its caption, or None where the run has no data for it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import norm

from . import figure_style as style
from .map_metrics import GRID_RESOLUTION_M, grid_on, terrain_at
from .survey_run import GridMap, SurveyRun
from .track_figures import Drawn

if TYPE_CHECKING:
    from .consistency import Consistency
    from .report import Evaluation


def seabed_maps(run: SurveyRun, evaluation: Evaluation) -> Drawn:
    """Draw the map's mean and spread beside the grid of cell means and the true terrain."""
    if not run.map.mean.size:
        return None
    ours = run.map
    others = {"Cell means of the beams": grid_on(ours, run.beams)}
    if run.terrain is not None:
        others["True seabed"] = terrain_at(run.terrain, ours)
    columns = 1 + len(others)
    height = 2 * (style.WIDTH_IN / columns * style.plan_aspect(run) * 0.85) + 1.5
    figure = Figure(figsize=(style.WIDTH_IN, min(height, 11)))
    axes = figure.subplots(2, columns, sharex=True, sharey=True, squeeze=False)

    depth = {"cmap": style.DEPTH_MAP, **style.colour_limits(ours.mean, *others.values())}
    for panel, (title, z) in zip(axes[0], {"GP map, mean": ours.mean, **others}.items()):
        mesh = style.draw_grid(panel, ours.x, ours.y, z, **depth)
        style.map_axes(panel, title)
    style.colour_bar(figure, mesh, list(axes[0]), style.DEPTH_LABEL)

    _draw_std(figure, axes[1, 0], run)
    differences = {f"GP map − {name.lower()}": ours.mean - z for name, z in others.items()}
    limits = style.colour_limits(*differences.values(), symmetric=True)
    for panel, (title, z) in zip(axes[1, 1:], differences.items()):
        mesh = style.draw_grid(panel, ours.x, ours.y, z, cmap=style.DIFFERENCE_MAP, **limits)
        style.map_axes(panel, title)
    style.colour_bar(figure, mesh, list(axes[1, 1:]), "difference (m)", location="bottom")
    for panel in axes.flat:
        panel.label_outer()
    return figure, (
        "The map and its uncertainty with the inducing points, beside the cell means of the same "
        "beams and the true seabed where known, on one colour scale, and the differences."
    )


def _draw_std(figure: Figure, axes, run: SurveyRun) -> None:
    grid: GridMap = run.map
    if grid.variance is not None:
        std = np.sqrt(grid.variance)
        limits = style.colour_limits(std)
        mesh = style.draw_grid(axes, grid.x, grid.y, std, cmap=style.SPREAD_MAP, **limits)
        style.colour_bar(figure, mesh, axes, "σ (m)", location="bottom")
    axes.scatter(
        *run.inducing_points[:, :2].T, s=5, color="white", edgecolor="black", linewidth=0.3
    )
    axes.set_xlim(grid.x[0], grid.x[-1])
    axes.set_ylim(grid.y[0], grid.y[-1])
    style.map_axes(axes, f"GP map, std; {len(run.inducing_points)} inducing points")


def held_out_residuals(run: SurveyRun, evaluation: Evaluation) -> Drawn:
    """Draw the residuals at held-out beams against what the map predicted of them."""
    scores = evaluation.held_out
    if scores is None:
        return None
    figure = Figure(figsize=(style.WIDTH_IN, 3.2))
    metres, standardised = figure.subplots(1, 2)
    on_grid = scores.grid_residual_m[scores.on_grid]
    reach = np.percentile(np.abs(np.concatenate([scores.residual_m, on_grid])), 99.5)
    bins = np.linspace(-reach, reach, 51) if reach > 0 else 10
    filled = {"bins": bins, "density": True, "histtype": "stepfilled"}
    outline = {"bins": bins, "density": True, "histtype": "step", "linewidth": 1.4}
    colour, other = style.COLOURS["estimate"], style.COLOURS["dead_reckoning"]
    metres.hist(scores.residual_m, color=colour, alpha=0.45, label="GP map", **filled)
    if len(on_grid):
        label = f"{GRID_RESOLUTION_M:g} m grid of cell means"
        metres.hist(on_grid, color=other, label=label, **outline)
    metres.set(xlabel="held-out z − predicted z (m)", ylabel="density (1/m)", title="Residuals")
    metres.legend(loc="upper left")

    span = np.linspace(-5, 5, 201)
    filled["bins"] = np.linspace(-5, 5, 51)
    standardised.hist(scores.standardised, color=colour, alpha=0.45, label="GP map", **filled)
    standardised.plot(span, norm.pdf(span), color="black", label="predicted, N(0, 1)")
    standardised.set(xlabel="residual / predicted std", ylabel="density", title="Standardised")
    standardised.legend(loc="upper left")
    return figure, (
        f"Residuals at {len(scores.residual_m)} held-out beams: in metres beside those of the "
        "plain grid, and divided by the predicted standard deviation, noise included, beside the "
        "density they should have."
    )


def consistency_maps(run: SurveyRun, evaluation: Evaluation) -> Drawn:
    """Draw where the passes disagree, for each trajectory."""
    order = ("dead_reckoning", "estimate", "ground_truth")
    results = {
        name: evaluation.consistencies[name]
        for name in order
        if name in evaluation.consistencies and len(evaluation.consistencies[name].error_m)
    }
    if not results:
        return None
    height = style.WIDTH_IN / len(results) * style.plan_aspect(run) * 0.9 + 0.8
    figure = Figure(figsize=(style.WIDTH_IN, min(height, 8)))
    all_axes = figure.subplots(1, len(results), sharex=True, sharey=True, squeeze=False)[0]
    limits = style.colour_limits(*(result.error_m for result in results.values()))
    limits["vmin"] = 0.0
    resolution_m = evaluation.report["consistency"]["resolution_m"]
    for axes, (name, result) in zip(all_axes, results.items()):
        x, y, error = _as_grid(run.map, result, resolution_m)
        mesh = style.draw_grid(axes, x, y, error, cmap=style.ERROR_MAP, **limits)
        style.map_axes(axes, f"{style.LABELS[name]}, RMS {result.overlap_rms_m:.3g} m")
        axes.label_outer()
    style.colour_bar(figure, mesh, list(all_axes), "consistency error (m)")
    return figure, (
        "How far apart different passes see the same seabed (Roman and Singh's consistency error), "
        f"per cell of {resolution_m:g} m that two passes or more have hit, on one colour scale."
    )


def _as_grid(area: GridMap, result: Consistency, resolution_m: float):
    """Return x, y and the error [nx, ny] over the map's extent, NaN where no passes meet."""
    first = [np.floor(axis[0] / resolution_m) for axis in (area.x, area.y)]
    last = [np.floor(axis[-1] / resolution_m) for axis in (area.x, area.y)]
    shape = [int(b - a) + 1 for a, b in zip(first, last)]
    index = (np.floor(result.centre_m / resolution_m) - first).astype(int)
    inside = ((index >= 0) & (index < shape)).all(axis=1)
    error = np.full(shape, np.nan)
    error[tuple(index[inside].T)] = result.error_m[inside]
    x, y = ((a + np.arange(n) + 0.5) * resolution_m for a, n in zip(first, shape))
    return x, y, error
