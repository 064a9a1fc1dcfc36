"""A whitened q(v) by the natural parameters of what the data say about it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from rbpf_svgp_slam.svgp import linalg


@dataclass(frozen=True)
class Moments:
    """q(v) = N(m, Σ) from its natural parameters Λ = Σ⁻¹ and Λm."""

    m: Tensor  # [S], in double precision
    F: Tensor  # [S, S] lower triangular, Σ = FᵀF, F⁻¹ the Cholesky factor of Λ
    log_determinant: float  # log|Σ|

    @property
    def trace(self) -> float:
        """tr Σ = tr FᵀF."""
        return self.F.square().sum(dtype=torch.float64).item()


def moments(precision: Tensor, shift: Tensor, weight: float, dtype: torch.dtype) -> Moments:
    """q(v) of Λ = I + weight·precision [S, S] and Λm = weight·shift [S], in double precision.

    dtype: of F. Raises `NotPositiveDefinite`.

    In double precision, because Λ's eigenvalues reach from 1, where no beam has been, to about
    N·o/σ², 3·10¹⁰ for 12 million beams of σ = 0.02 m: rounded to single precision Λ is not even
    positive definite. Its factor's condition is only the root of that. F is used in wide products,
    in their dtype, and inverting the factor in it loses no more than they do.
    """
    Lambda = precision * weight
    Lambda.diagonal().add_(1.0)
    C, info = torch.linalg.cholesky_ex(Lambda)
    if info.item() != 0:
        raise linalg.NotPositiveDefinite("precision of q(v): no Cholesky factor")
    m = torch.cholesky_solve(shift[:, None], C)[:, 0].mul_(weight)
    F = linalg.inverse_of_lower(C.to(dtype), torch.zeros_like(C, dtype=dtype))
    # log|Σ| = −log|Λ| = −2·Σ log C_ii
    return Moments(m, F, -2.0 * C.diagonal().log().sum().item())


class Site:
    """The likelihood's part of q(v), per beam: Λ = I + N·precision, Λm = N·(shift − c·shift_one).

    Each beam at x with depth y contributes (with a = L⁻¹ρ(Z, x))

        precision  o/σ²·a aᵀ        shift  √o/σ²·a y        shift_one  √o/σ²·a

    so that an average over beams is all there is to learn: a step of natural-gradient ascent of
    rate r on the ELBO (Salimbeni et al. 2018; Hensman et al. 2013, eq. 10) replaces a share r of
    it by the average over the minibatch. c is kept apart, and N not multiplied in, so that both
    take effect at once when they change.
    """

    def __init__(self, inducing_points: int, device: torch.device) -> None:
        S, double = inducing_points, torch.float64
        self.precision = torch.zeros((S, S), dtype=double, device=device)
        self.shift, self.shift_one = torch.zeros((2, S), dtype=double, device=device)

    def moments(self, N: int, c: float, dtype: torch.dtype) -> Moments:
        """q(v) for a log of N beams; dtype: of F."""
        return moments(self.precision, self.shift - c * self.shift_one, float(N), dtype)

    def replace(
        self, rate: float, G: Tensor, Ay: Tensor, A_one: Tensor, o: float, noise: float
    ) -> None:
        """A natural-gradient step to a minibatch of M: G = A Aᵀ/M, A y/M, A 1/M."""
        factor = rate * math.sqrt(o) / noise
        self.precision.mul_(1.0 - rate).add_(G, alpha=rate * o / noise)
        self.shift.mul_(1.0 - rate).add_(Ay, alpha=factor)
        self.shift_one.mul_(1.0 - rate).add_(A_one, alpha=factor)

    def transport(self, T: Tensor, factor: float, shift_factor: float) -> None:
        """To another model, where the projection of a beam is T [S, S] times what it was here.

        factor, shift_factor: the other model's o/σ² and √o/σ² over this one's.
        """
        self.precision = (T @ self.precision @ T.T).mul_(factor)
        self.shift = torch.mv(T, self.shift).mul_(shift_factor)
        self.shift_one = torch.mv(T, self.shift_one).mul_(shift_factor)

    def move_reference(self, rise_m: float) -> None:
        """Depths count from a reference that is lower by this much from now on."""
        self.shift.add_(self.shift_one, alpha=rise_m)
