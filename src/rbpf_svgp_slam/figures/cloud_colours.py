"""Colours of a seabed's point cloud: those of the report's figures, shaded alike."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import Normalize

from rbpf_svgp_slam.figures.figure_style import DEPTH_MAP, colour_limits, hill_shade


def seabed_rgb(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return red, green and blue [nx, ny, 3], uint8, of a seabed z [nx, ny] at x [nx], y [ny], m.

    Deep is dark blue. Shaded as if the sun stood in the north-west; black where z is NaN.
    """
    limits = colour_limits(z)
    rgb = DEPTH_MAP(Normalize(**limits)(np.nan_to_num(z, nan=limits["vmin"])))[..., :3]
    if min(z.shape) > 1:
        shade = hill_shade(x, y, z)
        opacity = shade[..., 3:]
        rgb = (1.0 - opacity) * rgb + opacity * shade[..., :3]
    rgb = np.where(np.isfinite(z)[..., None], rgb, 0.0)
    return np.rint(255.0 * rgb).astype(np.uint8)


def points_rgb(points: np.ndarray) -> np.ndarray:
    """Return the colours [n, 3], uint8, of points x y z [n, 3], m, of an even grid with holes."""
    (x, column), (y, row) = even_axis(points[:, 0]), even_axis(points[:, 1])
    z = np.full((len(x), len(y)), np.nan)
    z[column, row] = points[:, 2]
    return seabed_rgb(x, y, z)[column, row]


def even_axis(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return an axis of even steps that has all values [n], m, and each value's place on it [n]."""
    seen = np.unique(values)
    if len(seen) < 2:
        return seen, np.zeros(len(values), dtype=int)
    step = np.diff(seen).min()
    place = np.rint((values - seen[0]) / step).astype(int)
    return seen[0] + step * np.arange(place.max() + 1), place
