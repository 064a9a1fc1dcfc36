"""The SVGP against autograd, dense linear algebra and the exact Gaussian process."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from svgp_reference import (
    DOUBLE,
    covariance,
    dense_elbo,
    gp_sample,
    leaf,
    posterior,
    random_beams,
    random_parameters,
    set_optimal_q,
)

from rbpf_svgp_slam.svgp import linalg
from rbpf_svgp_slam.svgp.config import SvgpConfig
from rbpf_svgp_slam.svgp.kernels import KERNELS, Correlation
from rbpf_svgp_slam.svgp.objective import Objective, kl_divergence
from rbpf_svgp_slam.svgp.parameters import Parameters

NAMES = ("m", "R", "Z", "raw", "c")
# Large enough for well-conditioned references: what is compared is algebra, not rounding.
JITTER = 1e-2
# Around and between the widths of the blocks that linalg works in.
SIZES = st.sampled_from([1, 2, 7, linalg.BLOCK - 1, linalg.BLOCK, linalg.BLOCK + 1, 170])

kernels = pytest.mark.parametrize("kernel", sorted(KERNELS))


def evaluate(theta, X, y, N, kernel, jitter=JITTER):
    """The closed form: value and gradient, in the parameters' precision."""
    dtype = theta.flat.dtype
    objective = Objective(len(theta.m), len(y), kernel, jitter, dtype, "cpu")
    gradient = Parameters(len(theta.m), dtype, "cpu")
    return objective.evaluate(theta, X.to(dtype), y.to(dtype), N, gradient), gradient


def autograd(theta, X, y, N, kernel, jitter=JITTER):
    """The same, from the dense bound."""
    variables = leaf(theta)
    value = dense_elbo(variables, X, y, N, kernel, jitter)
    value.backward()
    gradient = Parameters(len(theta.m), DOUBLE, "cpu")
    gradient.flat.copy_(variables.flat.grad)
    return value.item(), gradient


def relative_errors(ours, theirs):
    """|ours − theirs|/|theirs| for each parameter; a gradient below 1e-6 counts as 1e-6."""
    pairs = {name: (getattr(ours, name), getattr(theirs, name)) for name in NAMES}
    return {
        name: float((a - b).norm() / b.norm().clamp_min(1e-6)) for name, (a, b) in pairs.items()
    }


@kernels
@given(S=SIZES, M=st.integers(1, 60), N=st.integers(1, 10**7), seed=st.integers(0, 10**6))
@settings(max_examples=15, deadline=None)
def test_value_and_gradients_equal_autograd_in_double_precision(kernel, S, M, N, seed):
    theta, (X, y) = random_parameters(S, seed), random_beams(M, seed)
    X[0] = theta.Z[0]  # a distance of zero
    value, gradient = evaluate(theta, X, y, N, kernel)
    expected, expected_gradient = autograd(theta, X, y, N, kernel)
    # Rounding of the dense reference, which inverts a matrix of condition up to S/JITTER.
    assert value == pytest.approx(expected, rel=1e-9, abs=1e-9)
    assert max(relative_errors(gradient, expected_gradient).values()) < 1e-8


@kernels
@given(seed=st.integers(0, 10**6))
@settings(max_examples=10, deadline=None)
def test_gradients_in_single_precision(kernel, seed):
    theta, (X, y) = random_parameters(150, seed, extent_m=100.0), random_beams(400, seed, 100.0)
    # As in a map: inducing points about a lengthscale apart.
    grid = torch.cartesian_prod(torch.arange(15.0), torch.arange(10.0)) * 10.0 - 50.0
    theta.Z.mul_(0.02).add_(grid)
    theta.set_hyperparameters(10.0, 2.0, 0.1)
    single = Parameters(150, torch.float32, "cpu")
    single.flat.copy_(theta.flat)
    value, gradient = evaluate(single, X, y, 10**5, kernel, jitter=1e-4)
    expected, expected_gradient = autograd(theta, X, y, 10**5, kernel, jitter=1e-4)
    # The unit of rounding, 6e-8, times the condition of Kzz, about 1e3 for Matérn-5/2 here.
    assert value == pytest.approx(expected, rel=1e-4)
    assert max(relative_errors(gradient, expected_gradient).values()) < 2e-4


@kernels
def test_default_and_other_kernels_are_matern(kernel):
    r = torch.tensor([0.0, 0.3, 2.0, 50.0], dtype=DOUBLE)
    Z, X = torch.zeros(1, 2, dtype=DOUBLE), torch.stack([0.6 * r, 0.8 * r], 1)
    rho = Correlation(kernel, (1, 4), DOUBLE, "cpu").evaluate(Z, X, 2.5)
    # Equal but for rounding: r = 0 counts as 1e-12 lengthscales.
    torch.testing.assert_close(rho, covariance(kernel, Z, X, 2.5, 1.0), rtol=1e-11, atol=0.0)


def test_default_kernel_is_matern_one_half():
    r = np.array([0.01, 1.0, 2.5, 10.0])
    X = torch.from_numpy(np.column_stack([r, 0.0 * r]))
    kernel = SvgpConfig().kernel
    rho = Correlation(kernel, (1, 4), DOUBLE, "cpu").evaluate(torch.zeros(1, 2), X, 2.5)
    np.testing.assert_allclose(rho[0], np.exp(-r / 2.5), rtol=1e-14)  # k(r) = o·exp(−r/ℓ)


def test_kl_divergence_is_torchs():
    theta = random_parameters(20, 3)
    factor = theta.R * torch.sign(theta.R.diagonal())  # columns may change sign
    q = torch.distributions.MultivariateNormal(theta.m, scale_tril=factor)
    zero, one = torch.zeros(20, dtype=DOUBLE), torch.eye(20, dtype=DOUBLE)
    p = torch.distributions.MultivariateNormal(zero, scale_tril=one)
    expected = torch.distributions.kl_divergence(q, p).item()
    assert kl_divergence(theta) == pytest.approx(expected, rel=1e-12)


def test_kl_is_weighted_by_the_size_of_the_log():
    theta, (X, y) = random_parameters(30, 5), random_beams(40, 5)
    few, few_gradient = evaluate(theta, X, y, 40, "matern12")
    many, many_gradient = evaluate(theta, X, y, 40_000, "matern12")
    weight = 1 / 40 - 1 / 40_000
    assert many - few == pytest.approx(weight * kl_divergence(theta), rel=1e-9)
    # ∂KL/∂m = m, ∂KL/∂R = R − diag(1/R_ii), and nothing else depends on N
    difference = many_gradient.flat - few_gradient.flat
    expected = Parameters(30, DOUBLE, "cpu")
    expected.m.copy_(theta.m)
    expected.R.copy_(theta.R - theta.R.diagonal().reciprocal().diag())
    torch.testing.assert_close(difference, weight * expected.flat, rtol=1e-9, atol=1e-12)


def test_a_zero_on_the_diagonal_of_R_has_a_finite_gradient_that_leads_away():
    theta, (X, y) = random_parameters(5, 1), random_beams(9, 1)
    theta.R[2, 2] = 0.0
    value, gradient = evaluate(theta, X, y, 1000, "matern12")
    assert math.isfinite(value)
    assert torch.isfinite(gradient.flat).all()
    assert gradient.R[2, 2] > 1.0


@kernels
def test_inducing_points_at_the_data_give_the_exact_gp(kernel):
    n, jitter = 60, 1e-10
    beams = gp_sample(n, 7, 10.0, 3.0, 2.0, 0.3)
    X, y = torch.from_numpy(beams[:, :2].copy()), torch.from_numpy(beams[:, 2] + 30.0)
    theta = random_parameters(n, 7)
    theta.Z.copy_(X)
    theta.set_hyperparameters(3.0, 2.0, 0.09)
    set_optimal_q(theta, X, y, kernel, jitter)

    test = random_beams(50, 8, 12.0)[0]
    mean, variance = posterior(theta, kernel, jitter).marginals(test)
    K = covariance(kernel, X, X, 3.0, 2.0) + 0.09 * torch.eye(n, dtype=DOUBLE)
    k = covariance(kernel, X, test, 3.0, 2.0)
    weights = torch.linalg.solve(K, k)
    # Rounding, and the jitter's share of the prior variance, enlarged by the noise's inverse.
    tolerances = {"rtol": 1e-7, "atol": 1e-7}
    torch.testing.assert_close(mean, theta.c + weights.T @ (y - theta.c), **tolerances)
    torch.testing.assert_close(variance, 2.0 - (k * weights).sum(0), **tolerances)

    # The bound is tight there: ELBO = log p(y)
    p = torch.distributions.MultivariateNormal(theta.c.expand(n), K)
    value, gradient = evaluate(theta, X, y, n, kernel, jitter)
    assert n * value == pytest.approx(p.log_prob(y).item(), abs=1e-5)
    # and q, being optimal, has no gradient
    assert gradient.m.norm() < 1e-7
    assert gradient.R.norm() < 1e-7


def test_optimal_q_has_no_gradient_with_fewer_inducing_points_than_data():
    theta, (X, y) = random_parameters(25, 11), random_beams(200, 11)
    set_optimal_q(theta, X, y, "matern12", JITTER)
    _, gradient = evaluate(theta, X, y, 200, "matern12")
    # Against gradients of order 1 elsewhere: rounding.
    assert gradient.m.norm() < 1e-10
    assert gradient.R.norm() < 1e-10
    assert gradient.Z.norm() > 1e-3


def test_prediction_in_chunks_equals_the_dense_formula():
    theta = random_parameters(12, 2)
    X = random_beams(2500, 2, 20.0)[0]
    mean, variance = posterior(theta, "matern32", JITTER).marginals(X)
    lengthscale, o, _ = theta.hyperparameters()
    K = covariance("matern32", theta.Z, theta.Z, lengthscale, o)
    K += JITTER * o * torch.eye(12, dtype=DOUBLE)
    k = covariance("matern32", theta.Z, X, lengthscale, o)
    L = torch.linalg.cholesky(K)
    projection = torch.linalg.solve(K, k)
    deviation = L @ theta.R @ theta.R.T @ L.T - K
    torch.testing.assert_close(mean, theta.c + projection.T @ L @ theta.m)
    torch.testing.assert_close(variance, o + (projection * (deviation @ projection)).sum(0))


@pytest.mark.parametrize("size", [1, linalg.BLOCK, linalg.BLOCK + 1, 2 * linalg.BLOCK + 13])
def test_products_by_blocks(size):
    A, B, C = torch.randn(3, size, size, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    R = A.tril()
    out, lower = torch.empty_like(A), torch.zeros_like(A)
    torch.testing.assert_close(linalg.gram(C[:, : size // 2 + 1], out), _gram(C, size // 2 + 1))
    torch.testing.assert_close(linalg.gram_of_lower(R, out), R @ R.T)
    torch.testing.assert_close(linalg.lower_of_product(A, B, lower), (A @ B).tril())
    torch.testing.assert_close(linalg.lower_of_product_with_lower(B, R, lower), (B @ R).tril())
    torch.testing.assert_close(linalg.gram_of_transposed_lower(R, out), R.T @ R)
    torch.testing.assert_close(linalg.product_with_lower(R, B, out), R @ B)
    torch.testing.assert_close(linalg.product_with_transposed_lower(R, B, out), R.T @ B)
    T = B.tril()
    torch.testing.assert_close(linalg.product_of_lowers(R, T, torch.zeros_like(A)), R @ T)
    well = R + 2.0 * size * torch.eye(size, dtype=DOUBLE)
    inverse = linalg.inverse_of_lower(well, torch.zeros_like(A))
    torch.testing.assert_close(inverse, torch.linalg.inv(well).tril())


def _gram(C, columns):
    return C[:, :columns] @ C[:, :columns].T


def test_cholesky_raises_the_jitter_and_says_so(caplog):
    K = torch.ones(3, 3)  # three inducing points at one place, singular in single precision
    L, failures = linalg.cholesky(K.clone(), 1e-9)
    assert failures > 0
    torch.testing.assert_close(L @ L.T, K, rtol=0, atol=2e-6)  # the jitter that was needed
    assert "jitter 1e-09" in caplog.text
    with pytest.raises(linalg.NotPositiveDefinite, match="no Cholesky with jitter 0.1"):
        linalg.cholesky(-K, 1e-9)
