"""How well a map predicts beams that it was never trained on, and how a plain grid does.

Everything is in metres and in the map frame; n held-out beams, T training beams.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RegularGridInterpolator
from scipy.spatial import cKDTree

from rbpf_svgp_slam.metrics.cells import cell_centres, cell_means
from rbpf_svgp_slam.run.survey_run import GridMap, Predict

GRID_RESOLUTION_M = 1.0
# A map prediction at n points holds arrays of [S, n]: 16,384 × 400 doubles are 52 MB.
_PREDICT_CHUNK = 16_384


@dataclass
class HeldOutScores:
    """Predictions of the n held-out beams that the map has a value for, and of a plain grid."""

    residual_m: np.ndarray  # [n] z − predicted mean
    variance_m2: np.ndarray  # [n] of the prediction, noise included
    grid_residual_m: np.ndarray  # [n] z − cell mean, NaN where the grid says nothing
    msll: float | None  # None without training beams
    coverage: float  # share of the held-out beams for which the map has a prediction

    @property
    def standardised(self) -> np.ndarray:
        """Residuals [n] over their predicted standard deviations: N(0, 1) if the map is right."""
        return self.residual_m / np.sqrt(self.variance_m2)

    @property
    def on_grid(self) -> np.ndarray:
        """Mask [n] of the beams for which the grid has a value."""
        return np.isfinite(self.grid_residual_m)


def score_held_out(
    predict: Predict, noise_variance_m2: float, held_out: np.ndarray, training: np.ndarray
) -> HeldOutScores:
    """Score predictions of held_out (one row a beam), given what the map was trained on, [T, 3]."""
    held_out = np.asarray(held_out, dtype=float)
    mean, variance = predict_in_chunks(predict, held_out[:, :2])
    known = np.isfinite(mean) & np.isfinite(variance)
    held_out, mean, variance = held_out[known], mean[known], variance[known] + noise_variance_m2
    score = None
    if len(training):
        train_z = np.asarray(training[:, 2], dtype=float)
        score = msll(held_out[:, 2], mean, variance, train_z.mean(), train_z.var())
    return HeldOutScores(
        residual_m=held_out[:, 2] - mean,
        variance_m2=variance,
        grid_residual_m=held_out[:, 2] - grid_prediction(training, held_out[:, :2]),
        msll=score,
        coverage=float(known.mean()),
    )


def predict_in_chunks(predict: Predict, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the latent mean [n] and variance [n] at xy [n, 2]."""
    parts = [
        predict(xy[start : start + _PREDICT_CHUNK]) for start in range(0, len(xy), _PREDICT_CHUNK)
    ]
    if not parts:
        return np.empty(0), np.empty(0)
    mean, variance = (np.concatenate(column) for column in zip(*parts))
    return np.asarray(mean, dtype=float), np.asarray(variance, dtype=float)


def rmse(residual: np.ndarray) -> float | None:
    """Return the root mean square of residual [n]; None where there is none."""
    return float(np.sqrt(np.mean(np.square(residual)))) if len(residual) else None


def msll(
    z: np.ndarray, mean: np.ndarray, variance: np.ndarray, train_mean: float, train_variance: float
) -> float | None:
    """Mean standardised log loss of predictions N(mean, variance) [n] of z [n].

    Rasmussen and Williams (2006), section 2.5: the mean of −log p(z) minus the same under a
    Gaussian with the mean and variance of the training data. 0 is trivial, lower is better.
    """
    if not len(z) or not train_variance > 0:
        return None
    loss = _negative_log_density(z, mean, variance)
    trivial = _negative_log_density(z, train_mean, train_variance)
    return float(np.mean(loss - trivial))


def _negative_log_density(z, mean, variance):
    return 0.5 * (np.log(2 * np.pi * variance) + (z - mean) ** 2 / variance)


def grid_prediction(
    training: np.ndarray, xy: np.ndarray, resolution_m: float = GRID_RESOLUTION_M
) -> np.ndarray:
    """Predict z [n] at xy [n, 2] by the nearest filled cell's mean of training [T, 3].

    NaN where that cell is not among the 3 × 3 around the point: a grid knows nothing there.
    """
    z = np.full(len(xy), np.nan)
    if not len(training) or not len(xy):
        return z
    keys, mean = cell_means(training, resolution_m)
    centres = cell_centres(keys, resolution_m)
    _, nearest = cKDTree(centres).query(xy)
    own = np.floor(xy / resolution_m)
    steps = np.abs(np.floor(centres[nearest] / resolution_m) - own).max(axis=1)
    return np.where(steps <= 1, mean[nearest], np.nan)


def grid_on(grid: GridMap, points: np.ndarray) -> np.ndarray:
    """Return the mean z [nx, ny] of points [n, 3] per cell of the given grid, NaN where none is.

    A point belongs to the cell whose centre is nearest; points outside the grid are left out.
    """
    i, inside_x = _nearest_index(grid.x, points[:, 0])
    j, inside_y = _nearest_index(grid.y, points[:, 1])
    inside = inside_x & inside_y
    cell = i[inside] * len(grid.y) + j[inside]
    size = grid.mean.size
    count = np.bincount(cell, minlength=size)
    total = np.bincount(cell, weights=points[inside, 2], minlength=size)
    mean = np.divide(total, count, out=np.full(size, np.nan), where=count > 0)
    return mean.reshape(grid.mean.shape)


def _nearest_index(centres: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    middles = (centres[1:] + centres[:-1]) / 2
    half_step = (centres[1] - centres[0]) / 2 if len(centres) > 1 else 0.5
    inside = (values >= centres[0] - half_step) & (values < centres[-1] + half_step)
    return np.searchsorted(middles, values, side="right"), inside


def terrain_at(terrain: GridMap, grid: GridMap) -> np.ndarray:
    """Return the terrain's z [nx, ny], bilinear, at the cells of the given grid; NaN outside."""
    sample = RegularGridInterpolator(
        (terrain.x, terrain.y), terrain.mean, bounds_error=False, fill_value=np.nan
    )
    return sample(tuple(np.meshgrid(grid.x, grid.y, indexing="ij")))
