"""Stationary Matérn kernels and the closed form of their derivatives.

Every kernel is written as k(x, x') = o·ρ(t) with t = ν̃·|x − x'|/ℓ and ν̃ = √(2ν)
(Rasmussen and Williams 2006, eq. 4.14), and comes with

    h(t) = −ρ'(t)/t

because both derivatives are then products, without a division by a distance that may be zero:

    ∂ρ/∂x = −h·(ν̃/ℓ)²·(x − x')        ∂ρ/∂ℓ = h·t²/ℓ
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

#: t is never smaller, so that h is finite; where x = x' it is multiplied by x − x' = 0 anyway.
SMALLEST_T = 1e-12


class Matern12:
    """ρ(t) = exp(−t), t = r/ℓ: the paper's kernel."""

    scale = 1.0

    @staticmethod
    def evaluate(t: Tensor, rho: Tensor, h: Tensor) -> None:
        """Fill rho, h [..] with ρ(t), h(t) for t [..] > 0."""
        # h = exp(−t)/t
        torch.neg(t, out=rho).exp_()
        torch.div(rho, t, out=h)


class Matern32:
    """ρ(t) = (1 + t)·exp(−t), t = √3·r/ℓ."""

    scale = math.sqrt(3.0)

    @staticmethod
    def evaluate(t: Tensor, rho: Tensor, h: Tensor) -> None:
        """Fill rho, h [..] with ρ(t), h(t) for t [..] > 0."""
        # h = exp(−t)
        torch.neg(t, out=h).exp_()
        torch.addcmul(h, h, t, out=rho)


class Matern52:
    """ρ(t) = (1 + t + t²/3)·exp(−t), t = √5·r/ℓ."""

    scale = math.sqrt(5.0)

    @staticmethod
    def evaluate(t: Tensor, rho: Tensor, h: Tensor) -> None:
        """Fill rho, h [..] with ρ(t), h(t) for t [..] > 0."""
        # h = (1 + t)·exp(−t)/3, ρ = 3·h + t²·exp(−t)/3
        torch.neg(t, out=rho).exp_()
        torch.addcmul(rho, rho, t, out=h).div_(3.0)
        rho.mul_(t).mul_(t).div_(3.0).add_(h, alpha=3.0)


KERNELS = {"matern12": Matern12, "matern32": Matern32, "matern52": Matern52}


class Correlation:
    """ρ(Z, X) of two sets of points, and the gradients that flow back through it.

    Buffers [S, M] are allocated once and filled by every call of `evaluate`.
    """

    def __init__(
        self, kernel: str, shape: tuple[int, int], dtype: torch.dtype, device: torch.device
    ) -> None:
        self.kernel = KERNELS[kernel]
        self.rho, self._h, self._t, self._dx, self._dy = (
            torch.empty(shape, dtype=dtype, device=device) for _ in range(5)
        )

    def evaluate(self, Z: Tensor, X: Tensor, lengthscale_m: float) -> Tensor:
        """Return ρ [S, M] between Z [S, 2] and X [M, 2], positions in metres.

        Distances come from the differences of each coordinate: |z|² + |x|² − 2·zᵀx would lose
        every digit of a small distance in float32.
        """
        self._lengthscale_m = lengthscale_m
        factor = self.kernel.scale / lengthscale_m
        # one contiguous row per coordinate: broadcasting strided ones is six times slower
        zx, zy = (Z.T * factor).contiguous()
        xx, xy = (X.T * factor).contiguous()
        # t² = dx² + dy², dx = (z − x)·ν̃/ℓ
        torch.sub(zx[:, None], xx, out=self._dx)
        torch.sub(zy[:, None], xy, out=self._dy)
        torch.mul(self._dx, self._dx, out=self._t).addcmul_(self._dy, self._dy)
        self._t.clamp_min_(SMALLEST_T**2).sqrt_()
        self.kernel.evaluate(self._t, self.rho, self._h)
        return self.rho

    def pull_back(self, W: Tensor, dZ: Tensor, dX: Tensor | None = None) -> float:
        """Gradients of a scalar E from W [S, M] = ∂E/∂ρ: returns ∂E/∂ℓ.

        ∂E/∂Z is added to dZ [S, 2], ∂E/∂X to dX [M, 2] if wanted. Belongs to the last `evaluate`,
        whose h is used up.
        """
        F = self._h.mul_(W)
        factor = self.kernel.scale / self._lengthscale_m
        dl = 0.0
        for axis, d in enumerate((self._dx, self._dy)):
            # ∂E/∂z = −ν̃/ℓ·Σ_x F·dx = −∂E/∂x summed over z      ∂E/∂ℓ = Σ F·(dx² + dy²)/ℓ
            P = torch.mul(F, d, out=self._t)
            dZ[:, axis].sub_(P.sum(1), alpha=factor)
            if dX is not None:
                dX[:, axis].add_(P.sum(0), alpha=factor)
            dl += torch.dot(P.view(-1), d.view(-1)).item() / self._lengthscale_m
        return dl
