"""Whether errors are as large as the covariances say that were given with the estimates."""

from __future__ import annotations

import numpy as np

from rbpf_svgp_slam.metrics.trajectory_errors import position_error

# A smaller variance, m² or a share of the largest, is rounding: 1 µm is nothing to a survey, and
# where all particles descend from one their covariance is zero but for it.
_ROUNDING = 1e-12


def symmetric(upper: np.ndarray) -> np.ndarray:
    """Return the covariances [n, 3, 3] of x, y, yaw whose upper triangles [n, 6] are given."""
    return np.asarray(upper)[:, [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]


def normalised_squares(error: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Return eᵀ S⁻¹ e [n] of errors [n, d] with covariances [n, d, d].

    NaN where the error is not known or the covariance not positive definite.
    """
    result = np.full(len(error), np.nan)
    finite = np.isfinite(error).all(axis=1) & np.isfinite(covariance).all(axis=(1, 2))
    known = np.flatnonzero(finite)
    variances = np.linalg.eigvalsh(covariance[known])
    known = known[variances[:, 0] > _ROUNDING * np.maximum(1.0, variances[:, -1])]
    e = error[known]
    result[known] = np.sum(e * np.linalg.solve(covariance[known], e[..., None])[..., 0], axis=1)
    return result


def nees(
    poses: np.ndarray, covariance: np.ndarray, truth: np.ndarray
) -> tuple[float | None, int | None]:
    """Return the mean of eᵀ S⁻¹ e / 2 over the poses, and how many are left out of it.

    The normalised estimation error squared (Bar-Shalom, Li and Kirubarajan 2001, section 5.4) per
    degree of freedom, of x and y: 1 where the covariance tells the error's size, more where it
    promises too much. poses, truth [P, 6]; covariance [P, 6], upper triangles of x, y, yaw. Left
    out are poses whose covariance is zero or not positive definite. None without truth.
    """
    error = position_error(poses, truth)[:, :2]
    known = np.isfinite(error).all(axis=1)
    if not known.any():
        return None, None
    squares = normalised_squares(error, symmetric(covariance)[:, :2, :2])
    scored = np.isfinite(squares)
    mean = float(squares[scored].mean()) / 2 if scored.any() else None
    return mean, int((known & ~scored).sum())
