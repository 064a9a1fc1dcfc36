"""Figures of the seabed: as measured, as mapped, their residuals, and the survey's consistency.

Each function returns a figure and its caption, or None where the run has no data for it.
"""

from __future__ import annotations

import itertools

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from scipy.ndimage import binary_dilation
from scipy.stats import norm

from rbpf_svgp_slam.charts.charted_seabed import masked_map
from rbpf_svgp_slam.charts.uncertainty import filled
from rbpf_svgp_slam.figures import figure_style as style
from rbpf_svgp_slam.figures.track_figures import Drawn, draw_track, mark_start_and_end
from rbpf_svgp_slam.metrics.consistency import Consistency
from rbpf_svgp_slam.metrics.evaluation import Evaluation
from rbpf_svgp_slam.metrics.map_metrics import GRID_RESOLUTION_M, grid_on, terrain_at
from rbpf_svgp_slam.run.survey_run import GridMap, SurveyRun

# Cells along an axis, at most. Where not all are hit, by a beam or by two passes, single ones would
# vanish.
_RAW_CELLS, _SPARSE_CELLS = 1000, 400
_PARTICLE_MAP = "particle's map"
# Of more points nothing could be seen below them.
_MOST_DOTS = 1000


def raw_bathymetry(run: SurveyRun, evaluation: Evaluation) -> Drawn:
    """Draw what the sonar measured, placed by dead reckoning alone."""
    raw = grid_of_beams(run, run.dead_reckoning, run.beams_dead_reckoning)
    if raw is None:
        return None
    figure, [[axes]] = style.map_subplots(run, 1)
    style.draw_depths(axes, raw.x, raw.y, within_a_cell(raw.mean), run)
    draw_track(axes, "dead_reckoning", run.dead_reckoning)
    if run.ground_truth is not None:
        draw_track(axes, "ground_truth", run.ground_truth)
    mark_start_and_end(axes, run.dead_reckoning)
    style.map_axes(axes, "Bathymetry as measured, placed by dead reckoning")
    style.legend_below(axes)
    resolution_m = raw.x[1] - raw.x[0]
    return figure, (
        f"All beams placed with dead reckoning, means of cells of {resolution_m:.3g} m: where its "
        "drift puts the same seabed at two places, relief is doubled or blurred. Shaded relief."
    )


def grid_of_beams(run: SurveyRun, poses: np.ndarray, beams: np.ndarray) -> GridMap | None:
    """Return the cell means of beams [N, 3] that were placed with poses [P, 6]; None without any.

    The cells are those of the map, but no finer than the pings' spacing, which would leave holes.
    """
    reach_m = np.hypot(*run.levelled[:, :2].T)
    known = np.isfinite(poses[:, :2]).all(axis=1)
    if not np.isfinite(reach_m).any() or known.sum() < 2:
        return None
    track = poses[known, :2]
    # The track and a swath on all sides, so that no outlier stretches the picture.
    margin_m = np.nanpercentile(reach_m, 99)
    low, high = track.min(axis=0) - margin_m, track.max(axis=0) + margin_m
    map_resolution_m = np.ptp(run.map.x[:2]) if len(run.map.x) > 1 else GRID_RESOLUTION_M
    spacing_m = np.median(np.linalg.norm(np.diff(track, axis=0), axis=1))
    resolution_m = max(map_resolution_m, spacing_m, (high - low).max() / _RAW_CELLS)
    x, y = (np.arange(a, b + resolution_m, resolution_m) for a, b in zip(low, high))
    grid = GridMap(x, y, np.empty((len(x), len(y))))
    grid.mean = grid_on(grid, beams[np.isfinite(beams).all(axis=1)])
    return grid


def posterior(run: SurveyRun, evaluation: Evaluation) -> Drawn:
    """Draw the best particle's map: its mean, and its variance with the support points."""
    grid = masked_map(run)
    if grid is None:
        return None
    has_variance = grid.variance is not None and np.isfinite(grid.variance).any()
    figure, panels = style.map_subplots(run, 2 if has_variance else 1)
    style.draw_depths(panels.flat[0], grid.x, grid.y, grid.mean, run)
    style.map_axes(panels.flat[0], "The best particle's map: posterior mean")
    caption = "The mean of the map that the best particle had, in shaded relief"
    if has_variance:
        _draw_variance(panels.flat[1], run, grid)
        caption += ", and the variance of its latent depth, on a logarithmic scale"
        if 0 < len(run.support_points) <= _MOST_DOTS:
            caption += f", with the {len(run.support_points)} {run.support_label} (dots)"
    return figure, caption + ". Grey where no beam fell: there the map is a guess."


def _draw_variance(axes: Axes, run: SurveyRun, grid: GridMap) -> None:
    positive = grid.variance[np.isfinite(grid.variance) & (grid.variance > 0)]
    limits = style.colour_limits(positive)
    if limits["vmin"] < limits["vmax"] and limits["vmin"] > 0:
        limits = {"norm": LogNorm(**limits)}
    image = style.draw_grid(axes, grid.x, grid.y, grid.variance, cmap=style.SPREAD_MAP, **limits)
    style.colour_bar(image, "variance of latent depth (m²)")
    has_dots = 0 < len(run.support_points) <= _MOST_DOTS
    if has_dots:
        dots = {"s": 7, "color": "white", "edgecolor": "black", "linewidth": 0.6}
        axes.scatter(*run.support_points[:, :2].T, **dots)
    axes.set_xlim(*image.get_extent()[:2])
    axes.set_ylim(*image.get_extent()[2:])
    points = f" and {run.support_label}" if has_dots else ""
    style.map_axes(axes, f"Posterior variance{points}")


def seabed_maps(run: SurveyRun, evaluation: Evaluation) -> Drawn:
    """Draw the seabed, the particle's map, the cell means and the truth, and their differences."""
    ours = masked_map(run)
    if ours is None:
        return None
    known = np.isfinite(ours.mean)
    seabeds = {_PARTICLE_MAP: ours.mean, "cell means": within_a_cell(grid_on(ours, run.beams))}
    if run.seabed is not None:
        seabeds = {"seabed": run.seabed.mean, **seabeds}
    # Of all against the truth, and one more, so that there are as many as seabeds; without the
    # truth, of each against each.
    pairs = list(itertools.combinations(seabeds, 2))
    if run.terrain is not None:
        pairs = [*((name, "true seabed") for name in seabeds), pairs[0]]
        seabeds["true seabed"] = terrain_at(run.terrain, ours)
    seabeds = {name: np.where(known, z, np.nan) for name, z in seabeds.items()}
    differences = {
        f"{a} − {b}".replace("true seabed", "truth"): seabeds[a] - seabeds[b] for a, b in pairs
    }
    figure, panels = style.map_subplots(run, len(seabeds) + len(differences))
    # Row by row for seabeds above their differences, column by column for seabeds beside them.
    panels = (panels.T if panels.shape == (len(seabeds), 2) else panels).ravel()
    image = _draw_panels(panels[: len(seabeds)], ours, seabeds, **style.depth_colours(run))
    style.depth_bar(image)
    limits = style.colour_limits(*differences.values(), symmetric=True)
    signed = {"cmap": style.DIFFERENCE_MAP, **limits}
    image = _draw_panels(panels[len(seabeds) :], ours, differences, **signed)
    style.colour_bar(image, "difference (m)")
    return figure, (
        "The seabed of the final trajectory, the best particle's map, the cell means of the same "
        "beams, and the true seabed where it is known, on one colour scale; and their differences "
        "on another. Grey where no beam fell within a cell."
    )


def within_a_cell(z: np.ndarray) -> np.ndarray:
    """z [nx, ny] with each NaN that lies beside a known cell, or at its corner, replaced by the
    nearest one's: as far as the seabed is known, and as a plain grid is scored."""
    near = binary_dilation(np.isfinite(z), np.ones((3, 3)))
    return np.where(near, filled(z), np.nan)


def _draw_panels(panels, grid: GridMap, layers: dict[str, np.ndarray], **scale) -> AxesImage:
    """Draw layers [nx, ny] on one colour scale; returns the last image."""
    for axes, (title, z) in zip(panels, layers.items()):
        image = style.draw_grid(axes, grid.x, grid.y, z, max_cells=_SPARSE_CELLS, **scale)
        style.map_axes(axes, title[0].upper() + title[1:])
    return image


def held_out_residuals(run: SurveyRun, evaluation: Evaluation) -> Drawn:
    """Draw the residuals at held-out beams against what the map predicted of them."""
    scored = {"seabed": evaluation.seabed_held_out, _PARTICLE_MAP: evaluation.held_out}
    scored = {name: scores for name, scores in scored.items() if scores is not None}
    if not scored:
        return None
    figure = Figure(figsize=(style.WIDTH_IN, 3.2))
    metres, standardised = figure.subplots(1, 2)
    scores = next(iter(scored.values()))
    on_grid = scores.grid_residual_m[scores.on_grid]
    residuals = {name: scores.residual_m for name, scores in scored.items()}
    if len(on_grid):
        residuals[f"{GRID_RESOLUTION_M:g} m grid of cell means"] = on_grid
    reach = np.percentile(np.abs(np.concatenate(list(residuals.values()))), 99.5)
    _draw_densities(metres, residuals, np.linspace(-reach, reach, 51) if reach > 0 else 10)
    metres.set(xlabel="held-out z − predicted z (m)", ylabel="density (1/m)", title="Residuals")
    metres.legend(loc="upper left")

    span = np.linspace(-5, 5, 201)
    ratios = {name: scores.standardised for name, scores in scored.items()}
    _draw_densities(standardised, ratios, np.linspace(-5, 5, 51))
    standardised.plot(span, norm.pdf(span), color="black", label="predicted, N(0, 1)")
    standardised.set(xlabel="residual / predicted std", ylabel="density", title="Standardised")
    standardised.legend(loc="upper left")
    return figure, (
        f"Residuals at {len(scores.residual_m)} held-out beams: in metres beside those of the "
        "plain grid, and divided by the predicted standard deviation, noise included, beside the "
        "density they should have."
    )


def _draw_densities(axes: Axes, layers: dict[str, np.ndarray], bins: np.ndarray | int) -> None:
    """Draw histograms of values [n]: the first filled, the others as outlines."""
    first, *_ = layers
    for (name, values), colour in zip(layers.items(), style.CURVE_COLOURS):
        look = {"histtype": "step", "linewidth": 1.4}
        if name == first:
            look = {"histtype": "stepfilled", "alpha": 0.45}
        axes.hist(values, bins=bins, density=True, color=colour, label=name, **look)


def consistency_maps(run: SurveyRun, evaluation: Evaluation) -> Drawn:
    """Draw where the passes disagree, for each trajectory, and where the map and the beams do."""
    titles = {**style.LABELS, "map": "map and beams"}
    results = {
        name: evaluation.consistencies[name]
        for name in ("dead_reckoning", "estimate", "ground_truth", "map")
        if name in evaluation.consistencies and len(evaluation.consistencies[name].error_m)
    }
    if not results:
        return None
    figure, panels = style.map_subplots(run, len(results))
    limits = style.colour_limits(*(result.error_m for result in results.values()))
    limits["vmin"] = 0.0
    resolution_m = evaluation.report["consistency"]["resolution_m"]
    for axes, (name, result) in zip(panels.flat, results.items()):
        x, y, error = _as_grid(run.map, result, resolution_m)
        scale = {"cmap": style.ERROR_MAP, "max_cells": _SPARSE_CELLS, **limits}
        image = style.draw_grid(axes, x, y, error, **scale)
        style.map_axes(axes, f"{titles[name]}, RMS {result.overlap_rms_m:.3g} m")
    style.colour_bar(image, "consistency error (m)")
    return figure, (
        "How far apart different passes see the same seabed (Roman and Singh's consistency error), "
        f"per cell of {resolution_m:g} m that two passes or more have hit; and the same between "
        "the map's mean and the beams. One colour scale; cells too small to be seen are averaged."
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
