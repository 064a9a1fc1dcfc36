"""The minibatch ELBO of a whitened SVGP and its gradients, both in closed form.

The bound is that of Hensman, Fusi and Lawrence 2013 (the paper's eq. 3) with the whitening of
Matthews 2017, per datum. The outputscale o is kept out of the matrices: with the unit kernel ρ,

    ρ(Z, Z) + jitter·I = L Lᵀ        A = L⁻¹ ρ(Z, X)        f = c + √o·Aᵀv,  v ~ N(m, Σ)

so that conditioning, jitter and whitening do not depend on o, and neither does ∂ELBO/∂o need the
kernel matrices. With e = y − c − √o·Aᵀm, G = A Aᵀ, H = I − Σ, s = 1/(σ²M):

    ELBO/N = −½·log 2πσ² − (eᵀe + o·(M − tr H G))/(2σ²M) − KL/N
    KL     = ½·(tr Σ + mᵀm − S − log|Σ|)

N is the number of beams in the log, M that of the minibatch. Adam keeps Σ = R Rᵀ.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import torch
from torch import Tensor

from rbpf_svgp_slam.svgp import linalg
from rbpf_svgp_slam.svgp.kernels import Correlation
from rbpf_svgp_slam.svgp.parameters import Model, Parameters, sum_of_elements
from rbpf_svgp_slam.svgp.prior import Prior


class Whitened(Protocol):
    """A q(v) = N(m, Σ), whatever its Σ is made from."""

    m: Tensor  # [S]

    @property
    def trace(self) -> float:
        """tr Σ."""

    @property
    def log_determinant(self) -> float:
        """log|Σ|."""


@dataclass(frozen=True)
class Residuals:
    """What a model and a q(v) leave unexplained of a minibatch."""

    lengthscale: float  # ℓ, m
    o: float  # outputscale, m²
    noise: float  # σ², m²
    s: float  # 1/(σ²M), 1/m²
    e: Tensor  # [M] y − c − √o·Aᵀm, m
    Ae: Tensor  # [S] A e, m
    squares: float  # eᵀe, m²
    trace: float  # tr H G

    @property
    def misfit(self) -> float:
        """eᵀe + o·(M − tr H G), m²: the expected sum of squares under q."""
        return self.squares + self.o * (len(self.e) - self.trace)

    @property
    def expected_log_likelihood(self) -> float:
        """−½·log 2πσ² − misfit/(2σ²M), nats per beam."""
        return -0.5 * (math.log(2.0 * math.pi * self.noise) + self.s * self.misfit)


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
        self.prior = Prior(S, kernel, jitter, dtype, device)
        self._zx = Correlation(kernel, (S, M), dtype, device)
        self._A = torch.empty((S, M), dtype=dtype, device=device)
        self._G, self._H, self._Q, self._V, self._T = (
            torch.zeros((S, S), dtype=dtype, device=device) for _ in range(5)
        )

    def evaluate(
        self, theta: Parameters, X: Tensor, y: Tensor, N: int, gradient: Parameters
    ) -> float:
        """Return ELBO/N in nats and fill gradient with its derivatives, for q(v) = N(m, R Rᵀ).

        X [M, 2] positions, m; y [M] z less the map's reference, m; N: beams in the log. Raises
        `NotPositiveDefinite`.
        """
        self.prior.factorise(theta)
        A = self.project(theta, X)
        # G = A Aᵀ      H = I − R Rᵀ
        G = linalg.gram(A, self._G)
        H = linalg.gram_of_lower(theta.R, self._H).neg_()
        H.diagonal().add_(1.0)
        residuals = self.residuals(theta, y, theta.m, G, H)
        self._variational_gradients(theta, residuals, N, gradient)
        self.model_gradients(theta.m, G, H, residuals, gradient)
        scale_raw_gradients(theta, gradient)
        return elbo(residuals, theta, N)

    def project(self, model: Model, X: Tensor) -> Tensor:
        """Return A [S, M] at X [M, 2], for the prior as last factorised; a buffer, used again."""
        rho = self._zx.evaluate(model.Z, X, model.hyperparameters()[0])
        return linalg.product_with_lower(self.prior.L_inverse, rho, self._A)

    def residuals(self, model: Model, y: Tensor, m: Tensor, G: Tensor, H: Tensor) -> Residuals:
        """Of y [M] at the positions last projected, under m [S], H [S, S], with G = A Aᵀ."""
        lengthscale, o, noise = model.hyperparameters()
        # e = y − c − √o·Aᵀm
        e = torch.addmv(y - model.c, self._A.T, m, alpha=-math.sqrt(o))
        return Residuals(
            lengthscale=lengthscale,
            o=o,
            noise=noise,
            s=1.0 / (noise * len(y)),
            e=e,
            Ae=torch.mv(self._A, e),
            squares=torch.mul(e, e).sum(dtype=torch.float64).item(),
            trace=sum_of_elements(torch.mul(H, G, out=self._V)),
        )

    def _variational_gradients(
        self, theta: Parameters, residuals: Residuals, N: int, gradient: Parameters
    ) -> None:
        """∂m [S] and ∂R [S, S], lower triangular."""
        o, s = residuals.o, residuals.s
        # ∂m = s·√o·A e − m/N
        torch.mul(residuals.Ae, s * math.sqrt(o), out=gradient.m).add_(theta.m, alpha=-1.0 / N)
        # ∂R = −s·o·tril(G R) − R/N + diag(1/(N·R_ii))
        linalg.lower_of_product_with_lower(self._G, theta.R, gradient.R)
        gradient.R.mul_(-s * o).add_(theta.R, alpha=-1.0 / N)
        gradient.R.diagonal().add_(theta.diagonal_of_R().reciprocal(), alpha=1.0 / N)

    def model_gradients(
        self, m: Tensor, G: Tensor, H: Tensor, residuals: Residuals, gradient: Model
    ) -> None:
        """Fill ∂Z [S, 2], ∂c, and for raw the derivatives by ℓ, o and σ² themselves.

        Uses up the kernel matrices of the positions last projected and of the prior.
        """
        o, s, M = residuals.o, residuals.s, self._A.shape[1]
        W, U = self._kernel_gradients(m, G, H, residuals)
        dZ = gradient.Z.zero_()
        dl = self._zx.pull_back(W, dZ) + self.prior.correlation.pull_back(U, dZ, dZ)
        # ∂c = s·Σe
        torch.sum(residuals.e, 0, keepdim=True, out=gradient.c).mul_(s)
        # ∂o = ½s·(mᵀA e/√o + tr H G − M)      ∂σ² = ½s·(misfit/σ² − M)
        do = 0.5 * s * (torch.dot(m, residuals.Ae).item() / math.sqrt(o) + residuals.trace - M)
        dnoise = 0.5 * s * (residuals.misfit / residuals.noise - M)
        gradient.raw.copy_(torch.tensor([dl, do, dnoise], dtype=torch.float64))

    def _kernel_gradients(
        self, m: Tensor, G: Tensor, H: Tensor, residuals: Residuals
    ) -> tuple[Tensor, Tensor]:
        """W [S, M] = ∂ELBO/∂ρ(Z, X), and U [S, S] for ρ(Z, Z), not symmetrised."""
        L_inverse, o, s = self.prior.L_inverse, residuals.o, residuals.s
        # Q = tril(s·√o·m (A e)ᵀ + s·o·H G), the diagonal halved
        Q = linalg.lower_of_product(H, G, self._Q).mul_(s * o)
        Q.addr_(m, residuals.Ae, alpha=s * math.sqrt(o)).tril_()
        Q.diagonal().mul_(0.5)
        # V = L⁻ᵀH      W = s·√o·L⁻ᵀm eᵀ + s·o·V A
        V = linalg.product_with_transposed_lower(L_inverse, H, self._V)
        alpha = torch.mv(L_inverse.T, m)
        W = torch.outer(alpha.mul_(s * math.sqrt(o)), residuals.e, out=self._zx.rho)
        W.addmm_(V, self._A, alpha=s * o)
        # U = −L⁻ᵀ Q L⁻¹; ρ(Z, Z) is symmetric, so that only U + Uᵀ matters
        T = linalg.product_of_lowers(Q, L_inverse, self._T)
        U = linalg.product_with_transposed_lower(L_inverse, T, self.prior.correlation.rho)
        return W, U.neg_()


def scale_raw_gradients(model: Model, gradient: Model) -> None:
    """Turn the derivatives by ℓ, o and σ² into those by their raw values."""
    slopes = torch.tensor(model.hyperparameter_slopes(), dtype=torch.float64)
    gradient.raw.copy_(gradient.raw.double() * slopes.to(gradient.raw.device))


def elbo(residuals: Residuals, q: Whitened, N: int) -> float:
    """ELBO/N of a minibatch's residuals under q, for a log of N beams, nats per beam."""
    return residuals.expected_log_likelihood - kl_divergence(q) / N


def kl_divergence(q: Whitened) -> float:
    """KL(q(v) ‖ N(0, I)) = ½·(tr Σ + mᵀm − S − log|Σ|), nats."""
    return 0.5 * (q.trace + torch.dot(q.m, q.m).item() - len(q.m) - q.log_determinant)
