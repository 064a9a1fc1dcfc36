"""Predictions from an SVGP as it stands."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Callable

import torch
from torch import Tensor

from rbpf_svgp_slam.svgp import linalg
from rbpf_svgp_slam.svgp.kernels import Correlation
from rbpf_svgp_slam.svgp.parameters import Model

#: So many points are predicted at once, which bounds the memory taken.
CHUNK = 2048


@dataclass(frozen=True)
class Gaussian:
    """The whitened q(v) = N(m, Σ), Σ in the form in which its optimizer has it."""

    m: Tensor  # [S]
    factor: Tensor  # [S, S] lower triangular: R of Σ = R Rᵀ, or F of Σ = FᵀF
    product: Callable[[Tensor, Tensor, Tensor], Tensor]  # of factor and A, of which ‖·‖² = AᵀΣA

    @classmethod
    def from_root(cls, m: Tensor, R: Tensor) -> Gaussian:
        """Σ = R Rᵀ."""
        return cls(m, R, linalg.product_with_transposed_lower)

    @classmethod
    def from_inverse_root(cls, m: Tensor, F: Tensor) -> Gaussian:
        """Σ = FᵀF, where F⁻¹ is the Cholesky factor of the precision."""
        return cls(m, F, linalg.product_with_lower)


class Posterior:
    """The seabed's marginals under q; holds until the parameters change."""

    def __init__(self, model: Model, q: Gaussian, kernel: str, L_inverse: Tensor) -> None:
        self._model, self._q, self._kernel, self._L_inverse = model, q, kernel, L_inverse
        self._lengthscale, self._o, _ = model.hyperparameters()

    def marginals(self, X: Tensor) -> tuple[Tensor, Tensor]:
        """Mean [n], m, less the map's reference, and variance [n], m², at X [n, 2]."""
        parts = [self._chunk(part) for part in X.split(CHUNK)]
        return tuple(torch.cat(columns) for columns in zip(*parts))

    def _chunk(self, X: Tensor) -> tuple[Tensor, Tensor]:
        model, q = self._model, self._q
        zx = Correlation(self._kernel, (len(q.m), len(X)), X.dtype, X.device)
        rho = zx.evaluate(model.Z, X, self._lengthscale)
        A = linalg.product_with_lower(self._L_inverse, rho, torch.empty_like(rho))
        # mean = c + √o·Aᵀm
        mean = torch.mv(A.T, q.m).mul_(math.sqrt(self._o)).add_(model.c)
        # variance = o·(1 − Σ A² + AᵀΣA): the prior's rest, never below 0, and q's own
        rest = (1.0 - A.square().sum(0)).clamp_min_(0.0)
        own = q.product(q.factor, A, rho).square_().sum(0)
        return mean, rest.add_(own).mul_(self._o)
