"""A survey area around all that the beams have reached. Needs no ROS."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from rbpf_svgp_slam.checking.facts import Facts

#: Beams that reach further from the vehicle than so many times what nearly all do are left out.
FAR_TIMES, NEARLY_ALL = 2.0, 95.0
#: A box along x and y is taken if it is not larger by this factor than the smallest box.
STRAIGHT_FACTOR = 1.25
#: Corners are rounded to whole metres, which moves them by up to 0.71 m; beams on the very edge
#: would count as outside.
ROUNDING_M = 1.0


def area_of_beams(facts: Facts) -> list[list[float]] | None:
    """Corners [[x, y], ...] of a rectangle in map, whole metres; None without beams."""
    reach_m = np.hypot(facts.beams["forward_m"], facts.beams["left_m"])
    return area_around(np.column_stack([facts.beams["x_m"], facts.beams["y_m"]]), reach_m)


def area_around(points_m: np.ndarray, reach_m: np.ndarray) -> list[list[float]] | None:
    """The same of points [N, 2] in map that lie so far from the vehicle, horizontally, [N], m."""
    if not len(reach_m):
        return None
    near = reach_m <= FAR_TIMES * max(np.percentile(reach_m, NEARLY_ALL), 0.1)
    points = points_m[near]
    straight = _box(points, 0.0)
    try:
        hull = points[ConvexHull(points).vertices]
    except QhullError:  # all on one line
        return _rounded(straight, 0.0)
    sides = np.roll(hull, -1, axis=0) - hull
    boxes = [(_box(hull, angle), angle) for angle in np.arctan2(sides[:, 1], sides[:, 0])]
    smallest, angle = min(boxes, key=lambda box: _size(box[0]))
    if _size(straight) <= STRAIGHT_FACTOR * _size(smallest):
        return _rounded(straight, 0.0)
    return _rounded(smallest, float(angle))


def _turn(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


def _box(points: np.ndarray, angle: float) -> np.ndarray:
    """Low and high corner [2, 2] in axes turned by the angle."""
    turned = points @ _turn(angle)
    return np.array([turned.min(axis=0), turned.max(axis=0)])


def _size(box: np.ndarray) -> float:
    return float(np.prod(box[1] - box[0]))


def _rounded(box: np.ndarray, angle: float) -> list[list[float]]:
    """The corners in map, outwards."""
    if angle == 0.0:
        (x0, y0), (x1, y1) = np.floor(box[0] - ROUNDING_M / 2), np.ceil(box[1] + ROUNDING_M / 2)
    else:
        (x0, y0), (x1, y1) = box[0] - ROUNDING_M, box[1] + ROUNDING_M
    x1, y1 = max(x1, x0 + ROUNDING_M), max(y1, y0 + ROUNDING_M)
    corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]) @ _turn(angle).T
    return [[float(x), float(y)] for x, y in np.round(corners)]
