"""The map as an occupancy grid, which RViz and rqt show without a plugin."""

from __future__ import annotations

import numpy as np
from nav_msgs.msg import OccupancyGrid
from std_msgs.msg import Header

from rbpf_svgp_slam.figures.cloud_colours import even_axis

UNKNOWN = -1


def depth_ranks(mean: np.ndarray, surveyed: np.ndarray) -> np.ndarray:
    """Ranks [n], int8, of a map's mean [n], m; UNKNOWN where not surveyed [n].

    0 is the shallowest of what is surveyed, 100 the deepest, 50 the median: every depth's share of
    the seabed has its share of the scale, so that relief is seen whatever its range.
    """
    ranks = np.full(len(mean), UNKNOWN, dtype=np.int8)
    known = np.flatnonzero(surveyed)
    shallow_first = known[np.argsort(-mean[known], kind="stable")]
    ranks[shallow_first] = np.rint(np.linspace(0.0, 100.0, len(known)))
    return ranks


def occupancy_grid(
    header: Header, points: np.ndarray, ranks: np.ndarray, resolution_m: float
) -> OccupancyGrid:
    """A grid of ranks [n] at points [n, 2], m, of an even grid; UNKNOWN between them.

    resolution_m: of the cells where the points are a single one.
    """
    (x, column), (y, row) = even_axis(points[:, 0]), even_axis(points[:, 1])
    for axis in (x, y):
        if len(axis) > 1:
            resolution_m = axis[1] - axis[0]
    cells = np.full((len(y), len(x)), UNKNOWN, dtype=np.int8)
    cells[row, column] = ranks
    grid = OccupancyGrid(header=header, data=cells.ravel().tolist())
    grid.info.map_load_time = header.stamp
    grid.info.resolution = resolution_m
    grid.info.width, grid.info.height = len(x), len(y)
    grid.info.origin.position.x = x[0] - resolution_m / 2
    grid.info.origin.position.y = y[0] - resolution_m / 2
    grid.info.origin.orientation.w = 1.0
    return grid
