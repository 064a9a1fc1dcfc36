"""Points over the survey area at which its map is drawn."""

from __future__ import annotations

import math

import numpy as np

from rbpf_svgp_slam.ros.parameters import Polygon


def survey_origin(area: Polygon) -> np.ndarray:
    """Centre [2] of the polygon's bounding box, frame map, m: the origin of x, y on the wire."""
    vertices = np.asarray(area)
    return (vertices.min(axis=0) + vertices.max(axis=0)) / 2


def survey_grid(area: Polygon, resolution_m: float, max_points: int) -> np.ndarray:
    """Grid points [n, 2] inside the polygon, frame map, m; coarser where there are too many."""
    vertices = np.asarray(area, dtype=float)
    while True:
        # The cells that the bounding box would have bound the memory that a try takes.
        cells = np.prod((np.ptp(vertices, axis=0) // resolution_m) + 1)
        if cells > 100 * max_points:
            resolution_m *= math.sqrt(cells / (100 * max_points)) * 1.01
            continue
        points = _grid(vertices, resolution_m)
        if len(points) <= max_points:
            return points
        resolution_m *= math.sqrt(len(points) / max_points) * 1.01


def _grid(vertices: np.ndarray, resolution_m: float) -> np.ndarray:
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    x, y = (np.arange(low[i] + resolution_m / 2, high[i], resolution_m) for i in range(2))
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    return points[inside(points, vertices)]


def inside(points: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Even-odd rule: [n] bool for points [n, 2] in the polygon of vertices [V, 2]."""
    x, y = points.T
    inside = np.zeros(len(points), dtype=bool)
    for (x0, y0), (x1, y1) in zip(vertices, np.roll(vertices, -1, axis=0)):
        if y0 == y1:
            continue
        crosses = (y0 > y) != (y1 > y)
        inside ^= crosses & (x < x0 + (y - y0) * (x1 - x0) / (y1 - y0))
    return inside
