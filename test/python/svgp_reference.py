"""Textbook forms of what rbpf_svgp_slam.svgp computes, in double precision and for tests only."""

import math

import numpy as np
import torch

from rbpf_svgp_slam.svgp.parameters import FLOORS, Parameters
from rbpf_svgp_slam.svgp.posterior import Gaussian, Posterior
from rbpf_svgp_slam.svgp.prior import Prior

DOUBLE = torch.float64


def correlation(kernel, r_over_l):
    """Matérn correlation of r/ℓ, Rasmussen and Williams 2006, eq. 4.17 and p. 85."""
    if kernel == "matern12":
        return torch.exp(-r_over_l)
    if kernel == "matern32":
        t = math.sqrt(3.0) * r_over_l
        return (1.0 + t) * torch.exp(-t)
    t = math.sqrt(5.0) * r_over_l
    return (1.0 + t + t * t / 3.0) * torch.exp(-t)


def covariance(kernel, X1, X2, lengthscale, outputscale):
    """k(X1, X2) [n1, n2]; the gradient of a zero distance is zero."""
    squares = ((X1[:, None] - X2[None]) ** 2).sum(-1)
    r = torch.where(squares > 0.0, squares, torch.ones_like(squares)).sqrt() * (squares > 0.0)
    return outputscale * correlation(kernel, r / lengthscale)


def random_parameters(S, seed, extent_m=10.0, spread=0.3):
    """Parameters of a half-trained map, R's diagonal with both signs."""
    generator = torch.Generator().manual_seed(seed)
    theta = Parameters(S, DOUBLE, "cpu")
    theta.m.copy_(torch.randn(S, generator=generator))
    theta.R.copy_((spread / math.sqrt(S) * torch.randn(S, S, generator=generator)).tril())
    signs = torch.sign(torch.rand(S, generator=generator) - 0.3)
    theta.R.diagonal().copy_(signs * (0.2 + torch.rand(S, generator=generator)))
    theta.Z.copy_(extent_m * (torch.rand(S, 2, generator=generator) - 0.5))
    theta.set_hyperparameters(0.3 * extent_m, 1.7, 0.25)
    theta.c.fill_(0.4)
    return theta


def random_beams(M, seed, extent_m=10.0):
    """Positions [M, 2] and depths [M]."""
    generator = torch.Generator().manual_seed(seed + 1)
    X = extent_m * (torch.rand(M, 2, generator=generator, dtype=DOUBLE) - 0.5)
    return X, torch.randn(M, generator=generator, dtype=DOUBLE)


def leaf(theta):
    """A copy of the parameters that autograd differentiates by."""
    copy = Parameters(len(theta.m), DOUBLE, "cpu")
    S = len(theta.m)
    copy.flat = theta.flat.detach().clone().requires_grad_()
    m, R, Z, raw, copy.c = copy.flat.split([S, S * S, 2 * S, 3, 1])
    copy.m, copy.R, copy.Z, copy.raw = m, R.view(S, S), Z.view(S, 2), raw
    return copy


def dense_elbo(theta, X, y, N, kernel, jitter):
    """ELBO/N from dense matrices, u = chol(Kzz)·v spelt out, differentiable."""
    S = len(theta.m)
    lengthscale, o, noise = torch.nn.functional.softplus(theta.raw) + torch.tensor(
        FLOORS, dtype=DOUBLE
    )
    Kzz = covariance(kernel, theta.Z, theta.Z, lengthscale, o) + jitter * o * torch.eye(
        S, dtype=DOUBLE
    )
    Kzx = covariance(kernel, theta.Z, X, lengthscale, o)
    L, R = torch.linalg.cholesky(Kzz), theta.R.tril()
    mean_u, covariance_u = L @ theta.m, L @ R @ R.T @ L.T
    projection = torch.linalg.solve(Kzz, Kzx)
    mean = theta.c + projection.T @ mean_u
    variance = o - ((Kzz - covariance_u) * (projection @ projection.T)).sum() / len(y)
    expected = -0.5 * torch.log(2.0 * math.pi * noise)
    expected = expected - 0.5 * (((y - mean) ** 2).mean() + variance) / noise
    # KL(N(μ, Σ) ‖ N(0, K)) = ½(tr K⁻¹Σ + μᵀK⁻¹μ − S + log|K| − log|Σ|)
    inverse = torch.linalg.inv(Kzz)
    kl = (inverse * covariance_u).sum() + mean_u @ inverse @ mean_u - S
    kl = 0.5 * (kl + torch.logdet(Kzz) - torch.logdet(covariance_u))
    return expected - kl / N


def set_optimal_q(theta, X, y, kernel, jitter):
    """Give theta the best q(v) for its kernel on all of X, y (Titsias 2009, eq. 10)."""
    S = len(theta.m)
    lengthscale, o, noise = theta.hyperparameters()
    K = covariance(kernel, theta.Z, theta.Z, lengthscale, o) + jitter * o * torch.eye(
        S, dtype=DOUBLE
    )
    A = torch.linalg.solve(torch.linalg.cholesky(K), covariance(kernel, theta.Z, X, lengthscale, o))
    # precision of v: I + A Aᵀ/σ²
    root = torch.linalg.cholesky(torch.eye(S, dtype=DOUBLE) + A @ A.T / noise)
    theta.m.copy_(torch.cholesky_solve((A @ (y - theta.c) / noise)[:, None], root)[:, 0])
    theta.R.copy_(torch.linalg.cholesky(torch.cholesky_inverse(root)))


def gp_sample(n, seed, extent_m, lengthscale_m, outputscale_m2, noise_std_m, kernel="matern12"):
    """Beams [n, 3] over a square, drawn from a GP with noise about −30 m."""
    rng = np.random.default_rng(seed)
    xy = extent_m * (rng.random((n, 2)) - 0.5)
    X = torch.from_numpy(xy)
    K = covariance(kernel, X, X, lengthscale_m, outputscale_m2).numpy()
    f = np.linalg.cholesky(K + 1e-9 * np.eye(n)) @ rng.standard_normal(n)
    return np.column_stack([xy, f - 30.0 + noise_std_m * rng.standard_normal(n)])


def posterior(theta, kernel, jitter):
    """Ours, for Adam's parameters."""
    prior = Prior(len(theta.m), kernel, jitter, theta.flat.dtype, "cpu")
    return Posterior(theta, Gaussian.from_root(theta.m, theta.R), kernel, prior.factorise(theta))
