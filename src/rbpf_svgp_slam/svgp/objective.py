"""The minibatch ELBO of a whitened SVGP and its gradients, both in closed form.

The bound is that of Hensman, Fusi and Lawrence 2013 (the paper's eq. 3) with the whitening of
Matthews 2017, per datum. The outputscale o is kept out of the matrices: with the unit kernel ρ,

    ρ(Z, Z) + jitter·I = L Lᵀ        A = L⁻¹ ρ(Z, X)        f = c + √o·Aᵀv,  v ~ N(m, R Rᵀ)

so that conditioning, jitter and triangular solves do not depend on o, and neither does ∂ELBO/∂o
need the kernel matrices. With e = y − c − √o·Aᵀm, G = A Aᵀ, H = I − R Rᵀ, s = 1/(σ²M):

    ELBO/N = −½·log 2πσ² − (eᵀe + o·(M − tr H G))/(2σ²M) − KL/N
    KL     = ½·(tr R Rᵀ + mᵀm − S − 2·Σ log|R_ii|)

N is the number of beams in the log, M that of the minibatch.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.linalg import solve_triangular

from rbpf_svgp_slam.svgp import linalg
from rbpf_svgp_slam.svgp.kernels import Correlation
from rbpf_svgp_slam.svgp.parameters import Parameters

#: |R_ii| counts as no less than this in log|R_ii|. The smallest that data can ask for is about
#: σ·√(S/(N·o)): 2e-5 for 12 million beams of σ = 0.02 m over a relief of 5 m.
SMALLEST_R_II = 1e-6


@dataclass(frozen=True)
class _Forward:
    """What the bound's value and its gradients share."""

    lengthscale: float  # ℓ, m
    o: float  # outputscale, m²
    noise: float  # σ², m²
    s: float  # 1/(σ²M), 1/m²
    e: Tensor  # [M] y − c − √o·Aᵀm, m
    Ae: Tensor  # [S] A e, m
    squares: float  # eᵀe, m²
    trace: float  # tr H G


class Objective:
    """The bound for S inducing points and minibatches of M beams.

    Keeps work space only: one instance serves all maps of the same shapes, one after the other.
    """

    def __init__(
        self,
        inducing_points: int,
        minibatch_size: int,
        kernel: str,
        jitter: float,
        dtype: torch.dtype,
        device: torch.device,
    ) -> None:
        S, M = inducing_points, minibatch_size
        self._jitter = jitter
        #: How often the last evaluation had to raise the jitter.
        self.jitter_raises = 0
        self._zz = Correlation(kernel, (S, S), dtype, device)
        self._zx = Correlation(kernel, (S, M), dtype, device)
        self._A = torch.empty((S, M), dtype=dtype, device=device)
        self._L = None
        self._G, self._H, self._Q, self._V = (
            torch.zeros((S, S), dtype=dtype, device=device) for _ in range(4)
        )

    def evaluate(
        self, theta: Parameters, X: Tensor, y: Tensor, N: int, gradient: Parameters
    ) -> float:
        """Return ELBO/N in nats and fill gradient with its derivatives.

        X [M, 2] positions, m; y [M] z less the map's reference, m; N: beams in the log. Raises
        `NotPositiveDefinite`.
        """
        forward = self._forward(theta, X, y)
        self._variational_gradients(theta, forward, N, gradient)
        self._model_gradients(theta, forward, gradient)
        # −½·log 2πσ² − (eᵀe + o·(M − tr H G))/(2σ²M) − KL/N
        misfit = forward.squares + forward.o * (len(y) - forward.trace)
        log_noise = math.log(2.0 * math.pi * forward.noise)
        return -0.5 * (log_noise + forward.s * misfit) - kl_divergence(theta) / N

    def _forward(self, theta: Parameters, X: Tensor, y: Tensor) -> _Forward:
        """Factorise Kzz, project the minibatch: L, A, G, H and the residuals."""
        lengthscale, o, noise = theta.hyperparameters()
        K = self._zz.evaluate(theta.Z, theta.Z, lengthscale)
        self._L, self.jitter_raises = linalg.cholesky(K, self._jitter)
        # A = L⁻¹ρ(Z, X)      G = A Aᵀ      H = I − R Rᵀ
        rho = self._zx.evaluate(theta.Z, X, lengthscale)
        A = solve_triangular(self._L, rho, upper=False, out=self._A)
        G = linalg.gram(A, self._G)
        H = linalg.gram_of_lower(theta.R, self._H).neg_()
        H.diagonal().add_(1.0)
        # e = y − c − √o·Aᵀm
        e = torch.addmv(y - theta.c, A.T, theta.m, alpha=-math.sqrt(o))
        return _Forward(
            lengthscale=lengthscale,
            o=o,
            noise=noise,
            s=1.0 / (noise * len(y)),
            e=e,
            Ae=A @ e,
            squares=torch.mul(e, e).sum(dtype=torch.float64).item(),
            # M − tr H G is a small difference of large numbers: summed in double precision
            trace=torch.mul(H, G, out=self._V).sum(dtype=torch.float64).item(),
        )

    def _variational_gradients(
        self, theta: Parameters, forward: _Forward, N: int, gradient: Parameters
    ) -> None:
        """∂m [S] and ∂R [S, S], lower triangular."""
        o, s = forward.o, forward.s
        # ∂m = s·√o·A e − m/N
        torch.mul(forward.Ae, s * math.sqrt(o), out=gradient.m).add_(theta.m, alpha=-1.0 / N)
        # ∂R = −s·o·tril(G R) − R/N + diag(1/(N·R_ii))
        linalg.lower_of_product_with_lower(self._G, theta.R, gradient.R)
        gradient.R.mul_(-s * o).add_(theta.R, alpha=-1.0 / N)
        gradient.R.diagonal().add_(_diagonal(theta.R).reciprocal(), alpha=1.0 / N)

    def _model_gradients(self, theta: Parameters, forward: _Forward, gradient: Parameters) -> None:
        """∂Z [S, 2], ∂c and the derivatives by the raw ℓ, o and σ²."""
        o, s, M = forward.o, forward.s, self._A.shape[1]
        W, U = self._kernel_gradients(theta, forward)
        dZ, _, dl = self._zx.pull_back(W)
        dZ_row, dZ_column, dl_zz = self._zz.pull_back(U)
        torch.add(dZ_row, dZ_column, out=gradient.Z).add_(dZ)
        # ∂c = s·Σe
        torch.sum(forward.e, 0, keepdim=True, out=gradient.c).mul_(s)
        # ∂o = ½s·(mᵀA e/√o + tr H G − M)      ∂σ² = ½s·((eᵀe + o·(M − tr H G))/σ² − M)
        variance = M - forward.trace
        do = 0.5 * s * (torch.dot(theta.m, forward.Ae).item() / math.sqrt(o) - variance)
        dnoise = 0.5 * s * ((forward.squares + o * variance) / forward.noise - M)
        slopes = theta.hyperparameter_slopes()
        raw = [d * slope for d, slope in zip((dl + dl_zz, do, dnoise), slopes)]
        gradient.raw.copy_(torch.tensor(raw, dtype=torch.float64))

    def _kernel_gradients(self, theta: Parameters, forward: _Forward) -> tuple[Tensor, Tensor]:
        """W [S, M] = ∂ELBO/∂ρ(Z, X), and U [S, S] for ρ(Z, Z), not symmetrised."""
        L, o, s = self._L, forward.o, forward.s
        # Q = tril(s·√o·m (A e)ᵀ + s·o·H G), the diagonal halved
        Q = linalg.lower_of_product(self._H, self._G, self._Q).mul_(s * o)
        Q.addr_(theta.m, forward.Ae, alpha=s * math.sqrt(o)).tril_()
        Q.diagonal().mul_(0.5)
        # V = L⁻ᵀH      W = s·√o·L⁻ᵀm eᵀ + s·o·V A
        V = solve_triangular(L.T, self._H, upper=True, out=self._V)
        alpha = solve_triangular(L.T, theta.m[:, None], upper=True)[:, 0]
        W = torch.outer(alpha * (s * math.sqrt(o)), forward.e, out=self._zx.rho)
        W.addmm_(V, self._A, alpha=s * o)
        # U = −L⁻ᵀ Q L⁻¹; ρ(Z, Z) is symmetric, so that only U + Uᵀ matters
        U = solve_triangular(L.T, Q, upper=True, out=self._V)
        U = solve_triangular(L, U, upper=False, left=False, out=self._zz.rho)
        return W, U.neg_()


def kl_divergence(theta: Parameters) -> float:
    """KL(q(v) ‖ N(0, I)) = ½·(tr R Rᵀ + mᵀm − S − 2·Σ log|R_ii|), nats."""
    m, R = theta.m, theta.R
    squares = (m * m).sum(dtype=torch.float64) + (R * R).sum(dtype=torch.float64)
    log_determinant = 2.0 * _diagonal(R).double().abs().log().sum()
    return 0.5 * (squares - len(m) - log_determinant).item()


def _diagonal(R: Tensor) -> Tensor:
    """R_ii [S], of either sign, but away from zero, where −log|R_ii| has its pole.

    Adam may step across the pole, which is harmless: only R Rᵀ matters. An element that happens
    to end on it would have a gradient without bounds, and at zero no sign to leave it by.
    """
    diagonal = R.diagonal()
    away = diagonal.abs().clamp_min_(SMALLEST_R_II)
    return torch.where(diagonal < 0.0, -away, away)
