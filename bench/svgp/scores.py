"""How good a map is: the same formulas for every contestant, on what its worker lets see."""

from __future__ import annotations

import math

import numpy as np

from bench.svgp.contestants import WorkerProcess
from bench.svgp.surveys import Beams

#: Beams that the ELBO is measured on.
EVALUATION_BEAMS = 4000


class Judge:
    """Held-out RMSE, m, and ELBO, nats per beam, of a worker's map."""

    def __init__(self, training: Beams, held_out: Beams) -> None:
        self._training, self._held_out = training, held_out

    def scores(self, worker: WorkerProcess, until_s: float = math.inf) -> tuple[float, float]:
        """RMSE and ELBO, on beams that have arrived by then."""
        apart = self._held_out.until(until_s)
        trained = self._training.until(until_s)
        # the same beams for every contestant
        rng = np.random.default_rng(0)
        sample = trained[rng.integers(0, len(trained), EVALUATION_BEAMS)]
        seen = worker.look(np.concatenate([apart[:, :2], sample[:, :2]]))
        mean, variance = seen["mean"], seen["variance"]
        rmse_m = math.sqrt(np.mean((mean[: len(apart)] - apart[:, 2]) ** 2))
        error_m, variance = mean[len(apart) :] - sample[:, 2], variance[len(apart) :]
        noise = seen["noise_variance_m2"].item()
        kl = _kl_divergence(seen["m"], seen["T"])
        return rmse_m, _expected_log_likelihood(error_m, variance, noise) - kl / len(trained)


def _expected_log_likelihood(error_m: np.ndarray, variance: np.ndarray, noise: float) -> float:
    """Per beam, nats; from errors [n], m, and latent variances [n], m²."""
    # −½·log 2πσ² − (e² + Var f)/(2σ²)
    misfit = float(np.mean(error_m**2 + variance))
    return -0.5 * (math.log(2.0 * math.pi * noise) + misfit / noise)


def _kl_divergence(m: np.ndarray, T: np.ndarray) -> float:
    """KL(q(v) ‖ N(0, I)), nats, for q(v) = N(m, Σ); m [S], T [S, S] triangular.

    The same for Σ = T Tᵀ and Σ = TᵀT, since only its trace and determinant count.
    """
    log_determinant = 2.0 * float(np.log(np.abs(np.diagonal(T))).sum())
    return 0.5 * (float((T**2).sum() + m @ m) - len(m) - log_determinant)
