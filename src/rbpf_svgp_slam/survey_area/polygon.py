"""The survey area as a polygon: what the map engine and the nodes both ask of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def inside(points: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Even-odd rule: [n] bool for points [n, 2] in the polygon of vertices [V, 2]."""
    x, y = points.T
    within = np.zeros(len(points), dtype=bool)
    for (x0, y0), (x1, y1) in zip(vertices, np.roll(vertices, -1, axis=0)):
        if y0 != y1:
            crosses = (y0 > y) != (y1 > y)
            within ^= crosses & (x < x0 + (y - y0) * (x1 - x0) / (y1 - y0))
    return within


def survey_origin(survey_area: ArrayLike) -> np.ndarray:
    """Centre [2] of the polygon's bounding box, m: the origin of x, y on the wire.

    See srv/GetMinibatches.srv; the core computes it in the same way.
    """
    vertices = np.asarray(survey_area, dtype=float)
    return (vertices.min(axis=0) + vertices.max(axis=0)) / 2


def around_origin(survey_area: ArrayLike) -> np.ndarray:
    """The polygon's vertices [V, 2] relative to the survey origin, m."""
    vertices = np.asarray(survey_area, dtype=float)
    return vertices - survey_origin(vertices)
