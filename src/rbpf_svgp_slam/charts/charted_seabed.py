"""What a chart is made of: the seabed where beams fell, and what its uncertainty depends on.

Shapes: P pings, N beams.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rbpf_svgp_slam.run.survey_run import GridMap, SurveyRun


@dataclass
class ChartedSeabed:
    """Frame map, m, rad, z up."""

    seabed: GridMap  # NaN where no beam fell
    noise_variance_m2: float  # of a beam about the seabed
    poses: np.ndarray  # [P, 6] x y z roll pitch yaw of the final estimate, NaN where unknown
    covariance: np.ndarray | None  # [P, 6] of it: xx, xy, x yaw, yy, y yaw, yaw yaw
    beams: np.ndarray  # [N, 3] that the seabed is made of: placed, and not held out
    ping_of_beam: np.ndarray  # [N]


def charted_seabed(run: SurveyRun) -> ChartedSeabed | None:
    """The run's seabed, or the best particle's map where beams fell; None if there is neither."""
    grid, noise_variance_m2 = run.seabed, run.noise_variance_m2
    used = np.isfinite(run.beams).all(axis=1) & ~run.held_out[run.ping_of_beam]
    if grid is not None:
        noise_variance_m2 = run.seabed_map.noise_variance_m2
    elif min(run.map.mean.shape) >= 2:
        grid = where_beams_fell(run.map, run.beams[used])
    if grid is None or not np.isfinite(grid.mean).any():
        return None
    return ChartedSeabed(
        seabed=grid,
        noise_variance_m2=noise_variance_m2,
        poses=run.estimate,
        covariance=run.estimate_covariance,
        beams=run.beams[used],
        ping_of_beam=run.ping_of_beam[used],
    )


def masked_map(run: SurveyRun) -> GridMap | None:
    """The best particle's map where the seabed is known: elsewhere it guesses. None where nothing
    is known."""
    seabed = charted_seabed(run)
    if seabed is None:
        return None
    known = np.isfinite(seabed.seabed.mean)
    mean, variance = (
        None if values is None else np.where(known, values, np.nan)
        for values in (run.map.mean, run.map.variance)
    )
    return GridMap(run.map.x, run.map.y, mean, variance) if np.isfinite(mean).any() else None


def where_beams_fell(grid: GridMap, beams: np.ndarray) -> GridMap:
    """The grid with NaN where none of beams [N, 3] fell within a cell of a centre: there a map
    guesses, and a seabed is masked."""
    half = [0.5 * (axis[1] - axis[0]) for axis in (grid.x, grid.y)]
    # The squares between four centres, of which those around a centre count.
    between = GridMap(
        np.append(grid.x - half[0], grid.x[-1] + half[0]),
        np.append(grid.y - half[1], grid.y[-1] + half[1]),
        np.empty((len(grid.x) + 1, len(grid.y) + 1)),
    )
    hit = beams_per_cell(between, beams[:, :2]) > 0
    seen = hit[1:, 1:] | hit[:-1, 1:] | hit[1:, :-1] | hit[:-1, :-1]
    variance = None if grid.variance is None else np.where(seen, grid.variance, np.nan)
    return GridMap(grid.x, grid.y, np.where(seen, grid.mean, np.nan), variance)


def beams_per_cell(grid: GridMap, xy: np.ndarray) -> np.ndarray:
    """How many of xy [n, 2] fell into each cell [nx, ny]."""
    cell, inside = cells_of(grid, xy)
    return np.bincount(cell[inside], minlength=grid.mean.size).reshape(grid.mean.shape)


def cells_of(grid: GridMap, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Index [n] of the cell, i · ny + j, that holds each of xy [n, 2]; and whether one does [n]."""
    spacing_m = [grid.x[1] - grid.x[0], grid.y[1] - grid.y[0]]
    i, j = np.floor((xy - [grid.x[0], grid.y[0]]) / spacing_m + 0.5).astype(np.int64).T
    inside = (i >= 0) & (i < len(grid.x)) & (j >= 0) & (j < len(grid.y))
    return i * len(grid.y) + j, inside
