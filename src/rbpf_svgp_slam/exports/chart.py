"""The seabed on a grid of the projected CRS, north up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates

from rbpf_svgp_slam.exports import s44
from rbpf_svgp_slam.exports.exported_run import ExportedRun
from rbpf_svgp_slam.exports.georeference import Georeference
from rbpf_svgp_slam.exports.uncertainty import position_variance
from rbpf_svgp_slam.run.survey_run import GridMap
from rbpf_svgp_slam.survey_area.grid import grid_points

# Cells that are projected together, to bound the memory.
_CELLS = 1_000_000
#: More would be no chart, but a survey whose map is in another place than its area.
MOST_CELLS = 200_000_000


@dataclass
class Chart:
    """Layers [rows, columns], the northern row first, m; NaN where no beam fell."""

    georeference: Georeference
    resolution_m: float  # of the grid; square cells
    west_m: float  # easting of the outer edge
    north_m: float  # northing of the outer edge
    elevation: np.ndarray  # up: the depth is its negative
    std: np.ndarray  # of a depth: all shares together
    seabed_std: np.ndarray  # of the seabed's mean
    position_std: np.ndarray  # what the trajectory's uncertainty gives
    density: np.ndarray  # int32: beams that fell in the cell
    order: np.ndarray  # uint8: IHO S-44's order, codes of s44.NAMES

    @property
    def easting(self) -> np.ndarray:
        """[columns] of the cells' centres."""
        return self.west_m + self.resolution_m * (np.arange(self.elevation.shape[1]) + 0.5)

    @property
    def northing(self) -> np.ndarray:
        """[rows] of the cells' centres, decreasing."""
        return self.north_m - self.resolution_m * (np.arange(self.elevation.shape[0]) + 0.5)

    @property
    def known(self) -> np.ndarray:
        """[rows, columns] bool: where there is a seabed."""
        return np.isfinite(self.elevation)


def make_chart(run: ExportedRun, georeference: Georeference) -> Chart:
    """Draw the run's seabed on the grid of the CRS.

    Bilinear between the map's cells, among those that are known; known where the nearest is.
    Variances are interpolated as the depths are, which is no less than the interpolated depth's.
    Beams are counted where they fell, not interpolated.
    """
    grid = run.seabed
    resolution_m = float(min(grid.x[1] - grid.x[0], grid.y[1] - grid.y[0]))
    west_m, north_m, rows, columns = _extent(grid, georeference, resolution_m)
    position = np.where(np.isfinite(grid.mean), position_variance(run), np.nan)
    layers = [grid.mean, grid.variance, position]
    drawn = np.empty((3, rows, columns))
    block = max(1, _CELLS // columns)
    easting = west_m + resolution_m * (np.arange(columns) + 0.5)
    for first in range(0, rows, block):
        northing = north_m - resolution_m * (np.arange(first, min(first + block, rows)) + 0.5)
        en = np.stack(np.meshgrid(easting, northing), axis=-1).reshape(-1, 2)
        values = _interpolated(grid, layers, georeference.from_projected(en))
        drawn[:, first : first + block] = values.reshape(3, -1, columns)
    elevation, seabed, position = drawn
    std = np.sqrt(seabed + run.noise_variance_m2 + position)
    corner = (west_m, north_m, resolution_m)
    return Chart(
        georeference=georeference,
        resolution_m=resolution_m,
        west_m=west_m,
        north_m=north_m,
        elevation=elevation,
        std=std,
        seabed_std=np.sqrt(seabed),
        position_std=np.sqrt(position),
        density=_density(run, georeference, corner, elevation.shape),
        order=s44.orders_met(elevation, std),
    )


def _extent(
    grid: GridMap, georeference: Georeference, resolution_m: float
) -> tuple[float, float, int, int]:
    """West and north edge, rows and columns of the known seabed, at multiples of the resolution."""
    known = grid_points(grid.x, grid.y)[np.isfinite(grid.mean).ravel()]
    # Only the outline counts, and with it the corners of its cells.
    half = 0.5 * np.array([grid.x[1] - grid.x[0], grid.y[1] - grid.y[0]])
    corners = np.vstack([known + half * side for side in ([1, 1], [1, -1], [-1, 1], [-1, -1])])
    en = np.vstack(
        [
            georeference.projected(part)
            for part in np.array_split(corners, 1 + len(corners) // _CELLS)
        ]
    )
    low = np.floor(en.min(axis=0) / resolution_m)
    high = np.ceil(en.max(axis=0) / resolution_m)
    columns, rows = (high - low).astype(np.int64)
    if rows * columns > MOST_CELLS:
        raise ValueError(
            f"the seabed needs {rows} x {columns} cells of {resolution_m:g} m; expected at most "
            f"{MOST_CELLS}"
        )
    return float(low[0]) * resolution_m, float(high[1]) * resolution_m, int(rows), int(columns)


def _interpolated(grid: GridMap, layers: list[np.ndarray], xy: np.ndarray) -> np.ndarray:
    """Layers [k, n] at xy [n, 2] in map."""
    known = np.isfinite(grid.mean)
    # A border of nothing, so that the outer half of the outer cells is inside.
    weights = np.pad(known, 1).astype(float)
    index = [
        (positions - axis[0]) / (axis[1] - axis[0]) + 1
        for positions, axis in zip(xy.T, (grid.x, grid.y))
    ]
    total = map_coordinates(weights, index, order=1)
    nearest = [np.clip(np.rint(k), 0, n - 1).astype(int) for k, n in zip(index, weights.shape)]
    within = (weights[tuple(nearest)] > 0) & (total > 0)
    result = np.full((len(layers), len(xy)), np.nan)
    for row, layer in zip(result, layers):
        sums = map_coordinates(np.pad(np.where(known, layer, 0.0), 1), index, order=1)
        row[within] = sums[within] / total[within]
    return result


def _density(
    run: ExportedRun,
    georeference: Georeference,
    corner: tuple[float, float, float],
    shape: tuple[int, int],
) -> np.ndarray:
    """Beams [rows, columns] in each cell, int32."""
    west_m, north_m, resolution_m = corner
    counts = np.zeros(shape, np.int32)
    for part in np.array_split(run.beams[:, :2], 1 + len(run.beams) // _CELLS):
        easting, northing = georeference.projected(part).T
        column = np.floor((easting - west_m) / resolution_m).astype(np.int64)
        row = np.floor((north_m - northing) / resolution_m).astype(np.int64)
        inside = (row >= 0) & (row < shape[0]) & (column >= 0) & (column < shape[1])
        np.add.at(counts, (row[inside], column[inside]), 1)
    return counts
