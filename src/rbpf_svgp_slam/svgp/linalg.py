"""Products of symmetric and triangular matrices that skip the half which is known.

Two of BLAS's routines for these (syrk, trmm) cannot be reached through torch, and the third (trsm)
runs at half the speed of a plain matrix product. So each product is done here by blocks, by plain
matrix products of the blocks on and below the diagonal. At S = 400 this saves 35 to 65 % of each
product's time.

An `out` argument named *lower* has to be zero above its diagonal on entry, and is so on return.
"""

from __future__ import annotations

import logging

import torch
from torch import Tensor

logger = logging.getLogger(__name__)

#: Columns per block: narrow enough to skip most of the known half, wide enough to stay efficient.
BLOCK = 80
#: No jitter is tried beyond this share of the prior variance: the model would be another one.
LARGEST_JITTER = 0.1


def gram(A: Tensor, out: Tensor) -> Tensor:
    """out [S, S] = A Aᵀ for A [S, M]."""
    for i, j in _blocks(len(out)):
        torch.mm(A[i:], A[i:j].T, out=out[i:, i:j])
        out[i:j, j:] = out[j:, i:j].T
    return out


def gram_of_lower(R: Tensor, out: Tensor) -> Tensor:
    """out [S, S] = R Rᵀ for R [S, S] lower triangular."""
    for i, j in _blocks(len(out)):
        torch.mm(R[i:, :j], R[i:j, :j].T, out=out[i:, i:j])
        out[i:j, j:] = out[j:, i:j].T
    return out


def gram_of_transposed_lower(R: Tensor, out: Tensor) -> Tensor:
    """out [S, S] = RᵀR for R [S, S] lower triangular."""
    for i, j in _blocks(len(out)):
        torch.mm(R[i:, i:j].T, R[i:, :j], out=out[i:j, :j])
        out[:i, i:j] = out[i:j, :i].T
    return out


def lower_of_product(A: Tensor, B: Tensor, lower: Tensor) -> Tensor:
    """lower [S, S] = tril(A B) for A, B [S, S]."""
    for i, j in _blocks(len(lower)):
        torch.mm(A[i:], B[:, i:j], out=lower[i:, i:j])
        lower[i:j, i:j].tril_()
    return lower


def lower_of_product_with_lower(A: Tensor, R: Tensor, lower: Tensor) -> Tensor:
    """lower [S, S] = tril(A R) for A [S, S] and R [S, S] lower triangular."""
    for i, j in _blocks(len(lower)):
        torch.mm(A[i:, i:], R[i:, i:j], out=lower[i:, i:j])
        lower[i:j, i:j].tril_()
    return lower


def product_of_lowers(R: Tensor, T: Tensor, lower: Tensor) -> Tensor:
    """lower [S, S] = R T for R, T [S, S], both lower triangular."""
    for i, j in _blocks(len(lower)):
        torch.mm(R[i:j, :j], T[:j, :j], out=lower[i:j, :j])
    return lower


def product_with_lower(R: Tensor, A: Tensor, out: Tensor) -> Tensor:
    """out [S, n] = R A for R [S, S] lower triangular and A [S, n]."""
    for i, j in _blocks(len(R)):
        torch.mm(R[i:j, :j], A[:j], out=out[i:j])
    return out


def product_with_transposed_lower(R: Tensor, A: Tensor, out: Tensor) -> Tensor:
    """out [S, n] = Rᵀ A for R [S, S] lower triangular and A [S, n]."""
    for i, j in _blocks(len(R)):
        torch.mm(R[i:, i:j].T, A[i:], out=out[i:j])
    return out


def inverse_of_lower(L: Tensor, lower: Tensor) -> Tensor:
    """lower [S, S] = L⁻¹ for L [S, S] lower triangular."""
    for i, j in _blocks(len(L)):
        # [L₁ 0; B D]⁻¹ = [L₁⁻¹ 0; −D⁻¹ B L₁⁻¹  D⁻¹]
        identity = torch.eye(j - i, dtype=L.dtype, device=L.device)
        D_inverse = torch.linalg.solve_triangular(L[i:j, i:j], identity, upper=False)
        lower[i:j, i:j] = D_inverse
        if i > 0:
            torch.mm(D_inverse, L[i:j, :i] @ lower[:i, :i], out=lower[i:j, :i])
            lower[i:j, :i].neg_()
    return lower


def _blocks(size: int) -> list[tuple[int, int]]:
    """Bounds (i, j) of the blocks of columns, from left to right."""
    return [(i, min(i + BLOCK, size)) for i in range(0, size, BLOCK)]


class NotPositiveDefinite(ArithmeticError):
    """A covariance matrix has no Cholesky factor, whatever the jitter."""


def cholesky(K: Tensor, jitter: float) -> tuple[Tensor, int]:
    """Lower factor L [S, S] of K + jitter·I, which is left in K, and how often that failed.

    After a failure, which is always logged, the jitter is raised tenfold, up to LARGEST_JITTER.
    """
    added, failures = 0.0, 0
    while True:
        K.diagonal().add_(jitter - added)
        added = jitter
        L, info = torch.linalg.cholesky_ex(K)
        if info.item() == 0:
            return L, failures
        failures += 1
        logger.warning("covariance of the inducing points: no Cholesky with jitter %g", added)
        jitter *= 10.0
        if jitter > LARGEST_JITTER:
            raise NotPositiveDefinite(
                f"covariance of the inducing points: no Cholesky with jitter {added:g}"
            )
