"""The seabed on a grid of the projected CRS, north up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_erosion, map_coordinates

from rbpf_svgp_slam.charts import s44
from rbpf_svgp_slam.charts.charted_seabed import ChartedSeabed
from rbpf_svgp_slam.charts.georeference import Georeference, LocalFrame
from rbpf_svgp_slam.charts.uncertainty import position_variance
from rbpf_svgp_slam.run.survey_run import GridMap
from rbpf_svgp_slam.survey_area.grid import grid_points

# Cells that are projected together, to bound the memory.
_CELLS = 1_000_000
#: Some 4 GB of memory, all formats together.
MOST_CELLS = 20_000_000
#: In place of a number of soundings, where there is neither a seabed nor a sounding.
NO_DENSITY = -1


@dataclass
class Chart:
    """Layers [rows, columns], the northern row first, m; NaN where no beam fell."""

    georeference: Georeference | LocalFrame
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

    @property
    def surveyed_density(self) -> np.ndarray:
        """[rows, columns] int32: the density, and NO_DENSITY off the survey, so that 0 is a gap in
        it."""
        return np.where(self.known | (self.density > 0), self.density, NO_DENSITY).astype(np.int32)


def make_chart(
    run: ChartedSeabed, georeference: Georeference | LocalFrame, most_cells: int | None = None
) -> Chart:
    """Draw the run's seabed on a grid of the CRS, at the map's resolution, or a coarser one of no
    more than most_cells (MOST_CELLS).

    Bilinear between the map's cells, among those that are known; known where the nearest is.
    Variances are interpolated as the depths are, which is no less than the interpolated depth's.
    Beams are counted where they fell, not interpolated.
    """
    position = np.where(np.isfinite(run.seabed.mean), position_variance(run), np.nan)
    variance = run.seabed.variance
    if variance is None:
        variance = np.full(run.seabed.mean.shape, np.nan)
    frame = _frame_of(run.seabed, georeference, most_cells or MOST_CELLS)
    layers = [run.seabed.mean, variance, position]
    elevation, seabed, position = _drawn(run.seabed, layers, georeference, frame)
    std = np.sqrt(seabed + run.noise_variance_m2 + position)
    return Chart(
        georeference=georeference,
        resolution_m=frame.resolution_m,
        west_m=frame.west_m,
        north_m=frame.north_m,
        elevation=elevation,
        std=std,
        seabed_std=np.sqrt(seabed),
        position_std=np.sqrt(position),
        density=_density(run.beams[:, :2], georeference, frame),
        order=s44.orders_met(elevation, std),
    )


@dataclass(frozen=True)
class _Frame:
    """Where the grid lies in the CRS."""

    resolution_m: float
    west_m: float
    north_m: float
    rows: int
    columns: int


def _frame_of(grid: GridMap, georeference: Georeference | LocalFrame, most_cells: int) -> _Frame:
    """Around the known seabed, with edges at multiples of the resolution: the map's, doubled until
    there are not too many cells."""
    known = np.isfinite(grid.mean)
    rim = known & ~binary_erosion(known)
    centres = grid_points(grid.x, grid.y)[rim.ravel()]
    steps = np.array([grid.x[1] - grid.x[0], grid.y[1] - grid.y[0]])
    corners = [centres + 0.5 * steps * side for side in ([1, 1], [1, -1], [-1, 1], [-1, -1])]
    en = georeference.projected(np.vstack(corners))
    resolution_m = float(steps.min())
    while True:
        low = np.floor(en.min(axis=0) / resolution_m)
        high = np.ceil(en.max(axis=0) / resolution_m)
        columns, rows = (high - low).astype(np.int64).tolist()
        if rows * columns <= most_cells:
            west_m, north_m = float(low[0]) * resolution_m, float(high[1]) * resolution_m
            return _Frame(resolution_m, west_m, north_m, rows, columns)
        resolution_m *= 2.0


def _drawn(
    grid: GridMap, layers: list[np.ndarray], georeference: Georeference | LocalFrame, frame: _Frame
) -> np.ndarray:
    """Layers [k, nx, ny] of the grid as layers [k, rows, columns] of the frame."""
    drawn = np.empty((len(layers), frame.rows, frame.columns))
    block = max(1, _CELLS // frame.columns)
    easting = frame.west_m + frame.resolution_m * (np.arange(frame.columns) + 0.5)
    for first in range(0, frame.rows, block):
        rows = np.arange(first, min(first + block, frame.rows))
        northing = frame.north_m - frame.resolution_m * (rows + 0.5)
        en = np.stack(np.meshgrid(easting, northing), axis=-1).reshape(-1, 2)
        values = _interpolated(grid, layers, georeference.from_projected(en))
        drawn[:, rows] = values.reshape(len(layers), len(rows), frame.columns)
    return drawn


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


def _density(xy: np.ndarray, georeference: Georeference | LocalFrame, frame: _Frame) -> np.ndarray:
    """How many of xy [n, 2] in map fell into each cell [rows, columns], int32."""
    counts = np.zeros(frame.rows * frame.columns, np.int64)
    for part in np.array_split(xy, 1 + len(xy) // _CELLS):
        easting, northing = georeference.projected(part).T
        column = np.floor((easting - frame.west_m) / frame.resolution_m).astype(np.int64)
        row = np.floor((frame.north_m - northing) / frame.resolution_m).astype(np.int64)
        inside = (row >= 0) & (row < frame.rows) & (column >= 0) & (column < frame.columns)
        cell = (row * frame.columns + column)[inside]
        counts += np.bincount(cell, minlength=len(counts))
    return counts.reshape(frame.rows, frame.columns).astype(np.int32)
