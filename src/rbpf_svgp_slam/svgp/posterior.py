"""Predictions from an SVGP's parameters as they stand."""

from __future__ import annotations

import math

import torch
from torch import Tensor
from torch.linalg import solve_triangular

from rbpf_svgp_slam.svgp import linalg
from rbpf_svgp_slam.svgp.kernels import Correlation
from rbpf_svgp_slam.svgp.parameters import Parameters

#: Points predicted at once, which bounds the memory taken.
CHUNK = 2048


class Posterior:
    """The seabed's marginals under q; holds until the parameters change."""

    def __init__(self, theta: Parameters, kernel: str, jitter: float) -> None:
        S, self._theta, self._kernel = len(theta.m), theta, kernel
        self._lengthscale, self._o, _ = theta.hyperparameters()
        zz = Correlation(kernel, (S, S), theta.flat.dtype, theta.flat.device)
        self._L, _ = linalg.cholesky(zz.evaluate(theta.Z, theta.Z, self._lengthscale), jitter)

    def marginals(self, X: Tensor) -> tuple[Tensor, Tensor]:
        """Mean [n], m, less the map's reference, and variance [n], m², at X [n, 2]."""
        parts = [self._chunk(part) for part in X.split(CHUNK)]
        return tuple(torch.cat(columns) for columns in zip(*parts))

    def _chunk(self, X: Tensor) -> tuple[Tensor, Tensor]:
        theta, shape = self._theta, (len(self._theta.m), len(X))
        zx = Correlation(self._kernel, shape, X.dtype, X.device)
        A = solve_triangular(self._L, zx.evaluate(theta.Z, X, self._lengthscale), upper=False)
        # mean = c + √o·Aᵀm
        mean = torch.mv(A.T, theta.m).mul_(math.sqrt(self._o)).add_(theta.c)
        # variance = o·(1 − Σ A² + Σ (RᵀA)²): the prior's rest, never below 0, and q's own
        rest = (1.0 - A.square().sum(0)).clamp_min_(0.0)
        own = linalg.product_with_transposed_lower(theta.R, A).square_().sum(0)
        return mean, rest.add_(own).mul_(self._o)
