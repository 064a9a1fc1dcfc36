"""Points over the survey area at which its map is drawn."""

from __future__ import annotations

import math

import numpy as np

from rbpf_svgp_slam.parameters.rules import Polygon
from rbpf_svgp_slam.survey_area.polygon import inside


def survey_grid(area: Polygon, resolution_m: float, max_points: int) -> tuple[np.ndarray, float]:
    """Grid points [n, 2] inside the polygon, frame map, and their spacing, m.

    The grid is coarser than the resolution where that would be too many points.
    """
    vertices = np.asarray(area, dtype=float)
    while True:
        # The cells that the bounding box would have bound the memory that a try takes.
        cells = np.prod((np.ptp(vertices, axis=0) // resolution_m) + 1)
        if cells > 100 * max_points:
            resolution_m *= math.sqrt(cells / (100 * max_points)) * 1.01
            continue
        points = _grid(vertices, resolution_m)
        if len(points) <= max_points:
            return points, resolution_m
        resolution_m *= math.sqrt(len(points) / max_points) * 1.01


def cell_centres(area: Polygon, resolution_m: float) -> tuple[np.ndarray, np.ndarray]:
    """x [nx] and y [ny] of the cells that cover the polygon's bounding box, frame map, m."""
    vertices = np.asarray(area, dtype=float)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    x, y = (np.arange(low[i] + resolution_m / 2, high[i], resolution_m) for i in range(2))
    return x, y


def grid_points(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Points [nx ny, 2] of the grid, y running fastest."""
    return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)


def _grid(vertices: np.ndarray, resolution_m: float) -> np.ndarray:
    points = grid_points(*cell_centres(vertices, resolution_m))
    return points[inside(points, vertices)]
