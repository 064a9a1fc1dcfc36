"""How uncertain the charted depths are: the map's share, the trajectory's, and what is missing.

With the slope g = ∇z of the seabed and the covariance P of a beam's place,

    σ² = σ²_seabed + σ²_noise + gᵀ P g,

where σ²_seabed is the variance of the map's mean, σ²_noise that of a beam about the seabed, and P
follows from the ping's covariance C of x, y and yaw: P = J C Jᵀ with J = [1 0 −r_y; 0 1 r_x] for a
beam at r from the vehicle. P is the mean over the beams in a cell, as if all passes that have been
there erred together: independent passes err less.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import distance_transform_edt

from rbpf_svgp_slam.charts.charted_seabed import ChartedSeabed, cells_of

#: For every file's metadata.
INCLUDED = (
    "One standard deviation of a depth read off here: of the seabed's mean, of one beam about it, "
    "and the horizontal variance of the final trajectory times the squared slope."
)
WITHOUT_TRAJECTORY = (
    "One standard deviation of a depth read off here: of the seabed's mean and of one beam about "
    "it. The trajectory's share is 0, since the run has no covariances of it."
)
MISSING = (
    "Not in it: tide and the vertical datum, draft and the depth sensor, sound speed and "
    "refraction, roll, pitch and the sonar's mount, the clocks, the survey's origin."
)


def position_variance(run: ChartedSeabed) -> np.ndarray:
    """Variance [nx, ny], m², that the trajectory's uncertainty gives the depth of each cell."""
    shape = run.seabed.mean.shape
    if run.covariance is None:
        return np.zeros(shape)
    slope_x, slope_y = slopes(run.seabed.mean, run.seabed.x, run.seabed.y)
    xx, xy, yy = _place_covariance(run)
    # gᵀ P g; a covariance that is none, by rounding, must not take uncertainty away.
    return np.maximum(slope_x**2 * xx + 2 * slope_x * slope_y * xy + slope_y**2 * yy, 0.0)


def total_variance(run: ChartedSeabed) -> np.ndarray:
    """Variance [nx, ny], m², of a depth read off at each cell: all shares; NaN where unknown."""
    if run.seabed.variance is None:
        return np.full(run.seabed.mean.shape, np.nan)
    return run.seabed.variance + run.noise_variance_m2 + position_variance(run)


def slopes(z: np.ndarray, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """∂z/∂x and ∂z/∂y [nx, ny] of z [nx, ny], NaN where unknown: central differences, one-sided at
    the seabed's rim; of a cell without neighbours the nearest cell's."""
    return _slope(z, x), _slope(z.T, y).T


def filled(values: np.ndarray) -> np.ndarray:
    """values [nx, ny] with each NaN replaced by the nearest cell's value; 0 if there is none."""
    unknown = np.isnan(values)
    if unknown.all():
        return np.zeros_like(values)
    nearest = distance_transform_edt(unknown, return_distances=False, return_indices=True)
    return values[tuple(nearest)]


def _slope(z: np.ndarray, x: np.ndarray) -> np.ndarray:
    steps = np.diff(z, axis=0) / np.diff(x)[:, None]
    none = np.full((1, z.shape[1]), np.nan)
    sides = np.stack([np.vstack([none, steps]), np.vstack([steps, none])])
    count = np.isfinite(sides).sum(axis=0)
    slope = np.where(count > 0, np.nansum(sides, axis=0) / np.maximum(count, 1), np.nan)
    return filled(slope)


def _place_covariance(run: ChartedSeabed) -> list[np.ndarray]:
    """P's xx, xy, yy [nx, ny], m², mean over the beams of each cell."""
    cell, inside = cells_of(run.seabed, run.beams[:, :2])
    covariance = run.covariance[run.ping_of_beam]
    known = inside & np.isfinite(covariance).all(axis=1)
    cell, ping = cell[known], run.ping_of_beam[known]
    xx, xy, x_yaw, yy, y_yaw, yaw = covariance[known].T
    r_x, r_y = (run.beams[known, :2] - run.poses[ping, :2]).T
    of_beams = (
        xx - 2 * r_y * x_yaw + r_y**2 * yaw,
        xy + r_x * x_yaw - r_y * y_yaw - r_x * r_y * yaw,
        yy + 2 * r_x * y_yaw + r_x**2 * yaw,
    )
    shape, size = run.seabed.mean.shape, run.seabed.mean.size
    count = np.bincount(cell, minlength=size)
    means = []
    for values in of_beams:
        total = np.bincount(cell, values, minlength=size)
        mean = np.where(count > 0, total / np.maximum(count, 1), np.nan)
        means.append(filled(mean.reshape(shape)))
    return means
