"""Where the inducing points start: a uniform grid over the planned survey area (as the paper's)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rbpf_svgp_slam.survey_area.polygon import inside

#: A grid's pitches along its two axes differ by this factor at most.
LARGEST_PITCH_RATIO = 1.25
#: So many numbers of columns are tried at most, and with each so many of rows.
TRIALS = 12


def initial_inducing_points(survey_area: ArrayLike, count: int) -> np.ndarray:
    """Exactly `count` points [S, 2] of one regular, nearly square grid inside the survey area.

    survey_area: polygon [V, 2], m, convex or not. The grid lies along the sides of the area's
    bounding rectangle. The few points by which the best grid has too many are taken away at the
    area's edge, where they matter least.
    """
    vertices, area_m2 = _polygon(survey_area)
    axes = _grid_axes(vertices)
    vertices = vertices @ axes
    points = _best_grid(vertices, area_m2, count)
    return _without_excess(points, vertices, count) @ axes.T


def grid_pitch_m(survey_area: ArrayLike, count: int) -> float:
    """Distance between neighbours of a square grid of `count` points over the survey area."""
    return float(np.sqrt(_polygon(survey_area)[1] / count))


def _polygon(survey_area: ArrayLike) -> tuple[np.ndarray, float]:
    """Checked vertices [V, 2] and the area inside, m²."""
    vertices = np.asarray(survey_area, dtype=float)
    if vertices.ndim != 2 or vertices.shape[0] < 3 or vertices.shape[1] != 2:
        raise ValueError(f"survey_area has shape {vertices.shape}; expected [V, 2] with V >= 3")
    if not np.isfinite(vertices).all():
        raise ValueError(f"survey_area is {vertices.tolist()}; expected finite coordinates")
    x, y = (vertices - vertices.mean(axis=0)).T
    area_m2 = 0.5 * abs(float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))))
    if area_m2 <= 1e-9 * float(np.prod(np.ptp(vertices, axis=0))) or area_m2 == 0.0:
        raise ValueError(f"survey_area encloses {area_m2:g} m2; expected more than nothing")
    return vertices, area_m2


def _grid_axes(vertices: np.ndarray) -> np.ndarray:
    """Rotation [2, 2] whose columns lie along the smallest bounding rectangle of all sides."""
    sides = np.diff(np.vstack([vertices, vertices[:1]]), axis=0)
    lengths = np.hypot(*sides.T)
    candidates = [np.eye(2)]
    for x, y in sides[lengths > 0] / lengths[lengths > 0, None]:
        candidates.append(np.array([[x, -y], [y, x]]))
    extents = [float(np.prod(np.ptp(vertices @ axes, axis=0))) for axes in candidates]
    # Keep the map's own axes unless others are better by more than rounding.
    best = int(np.argmin(extents))
    return candidates[best if extents[best] < extents[0] * (1.0 - 1e-6) else 0]


def _best_grid(vertices: np.ndarray, area_m2: float, count: int) -> np.ndarray:
    """The grid that has at least `count` points inside, few too many, and nearly square cells."""
    width, height = np.ptp(vertices, axis=0)
    pitch = np.sqrt(area_m2 / count)
    while True:
        best, best_cost = None, np.inf
        for columns in _trials(0.9 * width / pitch, 1.2 * width / pitch):
            cell = width / columns
            for rows in _trials(
                height / cell / LARGEST_PITCH_RATIO, height / cell * LARGEST_PITCH_RATIO
            ):
                points = _cell_centres(vertices, columns, rows)
                excess = len(points) - count
                cost = excess / count + abs(np.log(cell * rows / height))
                if excess >= 0 and cost < best_cost:
                    best, best_cost = points, cost
        if best is not None:
            return best
        pitch *= 0.9


def _trials(low: float, high: float) -> np.ndarray:
    """Whole numbers from low to high, thinned out where there are many; at least one of them."""
    low, high = max(1, int(low)), max(1, int(np.ceil(high)))
    return np.unique(np.linspace(low, high, min(high - low + 1, TRIALS)).round().astype(int))


def _cell_centres(vertices: np.ndarray, columns: int, rows: int) -> np.ndarray:
    """Centres [n, 2] of the cells of the bounding rectangle that lie inside the polygon."""
    low, extent = vertices.min(axis=0), np.ptp(vertices, axis=0)
    i, j = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    steps = np.stack([i.ravel(), j.ravel()], axis=1) + 0.5
    points = low + steps * extent / (columns, rows)
    return points[inside(points, vertices)]


def _without_excess(points: np.ndarray, vertices: np.ndarray, count: int) -> np.ndarray:
    """Drop the points nearest to the polygon's edge, spread evenly among equally near ones."""
    excess = len(points) - count
    if excess == 0:
        return points
    distances = _edge_distances(points, vertices)
    nearest = np.partition(distances, excess - 1)[excess - 1]
    pool = np.flatnonzero(distances <= nearest * (1.0 + 1e-6))
    dropped = pool[np.linspace(0, len(pool) - 1, excess).round().astype(int)]
    return np.delete(points, dropped, axis=0)


def _edge_distances(points: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Distance [n] of points [n, 2] to the polygon's nearest side."""
    distances = np.full(len(points), np.inf)
    for start, end in zip(vertices, np.roll(vertices, -1, axis=0)):
        side = end - start
        length2 = max(float(side @ side), np.finfo(float).tiny)
        along = np.clip((points - start) @ side / length2, 0.0, 1.0)
        distances = np.minimum(distances, np.hypot(*(points - start - along[:, None] * side).T))
    return distances
