"""An exact Gaussian process of a few hundred beams, and the same for many particles."""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.optimize import minimize
from scipy.spatial.distance import cdist

#: A model is learned from every second, third, ... of more beams than these.
_MODEL_BEAMS = 128
_ITERATIONS = 10
#: Of the logarithms of outputscale, lengthscale and noise variance.
_BOUNDS = np.log([(1e-3, 1e2), (1.0, 60.0), (1e-3, 1.0)])
_SQRT3 = np.sqrt(3.0)


@dataclass(frozen=True)
class GpModel:
    """Matérn 3/2 with a constant mean, that of the beams."""

    outputscale_m2: float = 1.0
    lengthscale_m: float = 10.0
    noise_m2: float = 0.02

    def kernel(self, a_m: np.ndarray, b_m: np.ndarray) -> np.ndarray:
        """Covariances [n, m] between positions [n, 2] and [m, 2]."""
        r = (_SQRT3 / self.lengthscale_m) * cdist(a_m, b_m)
        return self.outputscale_m2 * (1.0 + r) * np.exp(-r)

    def learned(self, xy_m: np.ndarray, z_m: np.ndarray) -> GpModel:
        """The model of the greatest marginal likelihood of beams [n, 2], [n], sought from this."""
        every = -(-len(z_m) // _MODEL_BEAMS)
        xy_m, z_m = xy_m[::every], z_m[::every]
        log_start = np.clip(np.log(astuple(self)), *_BOUNDS.T)
        found = minimize(
            lambda log: -GpModel(*np.exp(log)).log_evidence(xy_m, z_m),
            log_start,
            method="L-BFGS-B",
            bounds=_BOUNDS,
            options={"maxiter": _ITERATIONS},
        )
        return GpModel(*np.exp(found.x))

    def log_evidence(self, xy_m: np.ndarray, z_m: np.ndarray) -> float:
        """log N(z; mean, K + sigma^2 I), without its constant."""
        try:
            gp = ExactGp(self, xy_m, z_m)
        except LinAlgError:
            return -np.inf
        return -0.5 * gp.off_m @ gp.alpha - np.log(np.diag(gp.cholesky[0])).sum()


class ExactGp:
    """Conditioned on n beams."""

    def __init__(self, model: GpModel, xy_m: np.ndarray, z_m: np.ndarray) -> None:
        """xy_m [n, 2], z_m [n]."""
        self._model, self._xy_m = model, xy_m
        self._mean_m = z_m.mean()
        self.off_m = z_m - self._mean_m
        gram = model.kernel(xy_m, xy_m)
        gram[np.diag_indices_from(gram)] += model.noise_m2
        self.cholesky = cho_factor(gram, lower=True, overwrite_a=True, check_finite=False)
        self.alpha = cho_solve(self.cholesky, self.off_m, check_finite=False)

    def predict(self, xy_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean [m] and variance [m] of the depth at positions [m, 2], noise not included."""
        cross = self._model.kernel(self._xy_m, xy_m)
        explained = np.einsum("nm,nm->m", cross, cho_solve(self.cholesky, cross))
        variance = self._model.outputscale_m2 - explained
        return self._mean_m + cross.T @ self.alpha, np.maximum(variance, 0.0)


def predict_for_particles(
    model: GpModel, beams_m: np.ndarray, z_m: np.ndarray, xy_m: np.ndarray, asked: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Means and variances [J, m] where asked [J, m], zero elsewhere.

    Beams [J, n, 2] and positions [J, m, 2] are each particle's own, depths z_m [n] are common.
    Particles whose histories are the same there, as those with one ancestor, share the work.
    """
    mean, variance = np.zeros(asked.shape), np.zeros(asked.shape)
    flat = beams_m.reshape(len(beams_m), -1)
    distinct, group = np.unique(flat, axis=0, return_inverse=True)
    for number, own_m in enumerate(distinct):
        of_group = asked & (group == number)[:, None]
        if of_group.any():
            gp = ExactGp(model, own_m.reshape(-1, 2), z_m)
            mean[of_group], variance[of_group] = gp.predict(xy_m[of_group])
    return mean, variance
