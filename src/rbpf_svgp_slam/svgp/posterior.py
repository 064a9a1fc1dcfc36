"""Predictions from an SVGP's parameters as they stand."""

from __future__ import annotations

import math

import torch
from torch.linalg import solve_triangular

from rbpf_svgp_slam.svgp import linalg
from rbpf_svgp_slam.svgp.kernels import Correlation

#: Points predicted at once, which bounds the memory taken.
CHUNK = 2048


class Posterior:
    """The seabed's marginals under q; holds until the parameters change."""

    def __init__(self, theta, kernel, jitter):
        S, self._theta, self._kernel = len(theta.m), theta, kernel
        self._lengthscale, self._o, _ = theta.hyperparameters()
        zz = Correlation(kernel, (S, S), theta.flat.dtype, theta.flat.device)
        self._L = linalg.cholesky(zz.evaluate(theta.Z, theta.Z, self._lengthscale), jitter)

    def marginals(self, X):
        """Mean [n], m, less the map's reference, and variance [n], m², at X [n, 2]."""
        parts = [self._chunk(part) for part in X.split(CHUNK)]
        return tuple(torch.cat(columns) for columns in zip(*parts))

    def _chunk(self, X):
        theta, shape = self._theta, (len(self._theta.m), len(X))
        zx = Correlation(self._kernel, shape, X.dtype, X.device)
        A = solve_triangular(self._L, zx.evaluate(theta.Z, X, self._lengthscale), upper=False)
        # mean = c + √o·Aᵀm
        mean = torch.addmv(theta.c, A.T, theta.m, alpha=math.sqrt(self._o))
        # variance = o·(1 − Σ A² + Σ (RᵀA)²): the prior's rest, never below 0, and q's own
        rest = (1.0 - A.square().sum(0)).clamp_min_(0.0)
        return mean, rest.add_((theta.R.T @ A).square_().sum(0)).mul_(self._o)
