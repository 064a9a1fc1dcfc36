"""Natural-gradient steps against their definition, the closed-form optimum and Adam."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from svgp_reference import (
    DOUBLE,
    covariance,
    dense_elbo,
    gp_sample,
    leaf,
    random_beams,
    random_parameters,
    set_optimal_q,
)

from rbpf_svgp_slam.svgp import linalg
from rbpf_svgp_slam.svgp.config import SvgpConfig
from rbpf_svgp_slam.svgp.minibatch_svgp import MinibatchSvgp
from rbpf_svgp_slam.svgp.natural import moments
from rbpf_svgp_slam.svgp.optimizers import NaturalGradient
from rbpf_svgp_slam.svgp.optimizers.optimizer import NotFinite

AREA = [[-15.0, -15.0], [15.0, -15.0], [15.0, 15.0], [-15.0, 15.0]]
JITTER = 1e-2
FIXED = SvgpConfig(
    inducing_points=25,
    optimizer="natgrad",
    jitter=JITTER,
    dtype="float64",
    learn_inducing_points=False,
    learn_hyperparameters=False,
)

kernels = pytest.mark.parametrize("kernel", ["matern12", "matern32", "matern52"])


def optimizer_for(theta, **changes):
    """A NaturalGradient with the model of theta and q(v) at the prior."""
    optimizer = NaturalGradient(replace(FIXED, inducing_points=len(theta.m), **changes))
    optimizer.model.flat.copy_(theta.model)
    return optimizer


def covariance_of(q):
    """Σ of a Gaussian as the optimizer gives it."""
    return q.factor.T @ q.factor


@kernels
def test_a_step_of_rate_one_on_all_data_is_the_closed_form_optimum(kernel):
    theta, (X, y) = random_parameters(25, 3), random_beams(300, 3)
    optimizer = optimizer_for(theta, kernel=kernel, natgrad_rate=1.0)
    # Whatever came before is forgotten.
    optimizer.step(*random_beams(40, 9), 77)
    optimizer.step(X, y, len(y))
    set_optimal_q(theta, X, y, kernel, JITTER)
    q = optimizer.gaussian()
    # Rounding in double precision, of matrices with a condition of up to S/JITTER.
    torch.testing.assert_close(q.m, theta.m, rtol=1e-9, atol=1e-10)
    torch.testing.assert_close(covariance_of(q), theta.R @ theta.R.T, rtol=1e-9, atol=1e-10)


def test_averaged_steps_reach_the_optimum_of_all_the_data():
    theta, (X, y) = random_parameters(25, 4), random_beams(400, 4)
    # The first step has rate 1, the second 1/2, ...: the average over four batches, each seen once.
    optimizer = optimizer_for(theta, natgrad_rate=1e-6)
    for part in range(4):
        optimizer.step(X[part::4], y[part::4], len(y))
    set_optimal_q(theta, X, y, "matern12", JITTER)
    torch.testing.assert_close(optimizer.gaussian().m, theta.m, rtol=1e-9, atol=1e-10)


def expectation_elbo(eta_1, eta_2, theta, X, y, N):
    """ELBO/N as a function of q's expectation parameters m and Σ + m mᵀ."""
    variables = leaf(theta)
    S = len(theta.m)
    variables.m = eta_1
    variables.R = torch.linalg.cholesky(eta_2 - torch.outer(eta_1, eta_1)).view(S, S)
    return dense_elbo(variables, X, y, N, "matern12", JITTER)


def test_a_step_follows_the_natural_gradient():
    # nat ← nat + r·N·∂(ELBO/N)/∂η, with nat = (Σ⁻¹m, −½Σ⁻¹), η = (m, Σ + m mᵀ)
    # (Salimbeni et al. 2018, eq. 10 with the natural parametrisation), by autograd.
    rate, N = 0.3, 5000
    theta = random_parameters(12, 5)
    optimizer = optimizer_for(theta, natgrad_rate=rate)
    for seed in range(8):  # past the first steps, whose rate is 1/t
        optimizer.step(*random_beams(50, seed), N)
    before = optimizer.gaussian()
    precision = torch.linalg.inv(covariance_of(before))
    X, y = random_beams(50, 99)
    eta_1 = before.m.clone().requires_grad_()
    eta_2 = (covariance_of(before) + torch.outer(before.m, before.m)).requires_grad_()
    expectation_elbo(eta_1, eta_2, theta, X, y, N).backward()
    nat_1 = precision @ before.m + rate * N * eta_1.grad
    nat_2 = -0.5 * precision + rate * N * 0.5 * (eta_2.grad + eta_2.grad.T)

    optimizer.step(X, y, N)
    after = optimizer.gaussian()
    precision = torch.linalg.inv(covariance_of(after))
    # Rounding: two inverses of matrices whose condition is about 1e4.
    torch.testing.assert_close(-0.5 * precision, nat_2, rtol=1e-7, atol=1e-6)
    torch.testing.assert_close(precision @ after.m, nat_1, rtol=1e-7, atol=1e-6)


def test_elbo_of_a_model_step_is_the_dense_bound():
    theta, N = random_parameters(20, 6), 3000
    optimizer = optimizer_for(theta, natgrad_model_period=1)
    optimizer.step(*random_beams(60, 1), N)
    q, (X, y) = optimizer.gaussian(), random_beams(60, 2)
    theta.m.copy_(q.m)
    theta.R.copy_(torch.linalg.cholesky(covariance_of(q)))
    expected = dense_elbo(leaf(theta), X, y, N, "matern12", JITTER).item()
    assert optimizer.step(X, y, N) == pytest.approx(expected, rel=1e-9)


def test_sigma_and_c_of_a_model_step_have_no_gradient_left():
    theta, N = random_parameters(20, 6), 3000
    optimizer = optimizer_for(theta, learn_hyperparameters=True, natgrad_rate=1.0)
    optimizer.step(*random_beams(60, 1), N)
    q, (X, y) = optimizer.gaussian(), random_beams(60, 2)
    theta.model.copy_(optimizer.model.flat)
    theta.m.copy_(q.m)
    theta.R.copy_(torch.linalg.cholesky(covariance_of(q)))
    optimizer.step(X, y, N)  # with rate 1: to the best values for this q, if not for each other
    for name, index in (("σ²", 2), ("c", 3)):
        at_best = random_parameters(20, 6)
        at_best.flat.copy_(theta.flat)
        at_best.model[-4 + index] = optimizer.model.flat[-4 + index]
        variables = leaf(at_best)
        dense_elbo(variables, X, y, N, "matern12", JITTER).backward()
        # Gradients of order 0.1 to 1 elsewhere; exact but for rounding.
        assert abs(variables.flat.grad[-4 + index].item()) < 1e-9, name


def test_the_size_of_the_log_takes_effect_at_once():
    theta, (X, y) = random_parameters(20, 7), random_beams(100, 7)
    optimizers = [optimizer_for(theta), optimizer_for(theta)]
    for optimizer, N in zip(optimizers, (100, 10_000)):
        optimizer.step(X, y, N)
    traces = [covariance_of(optimizer.gaussian()).trace() for optimizer in optimizers]
    assert traces[1] < 0.2 * traces[0]


def test_a_step_that_is_not_finite_changes_nothing():
    for steps_before in (0, 5):
        optimizer = optimizer_for(random_parameters(20, 8), learn_hyperparameters=True)
        for seed in range(steps_before):
            optimizer.step(*random_beams(50, seed), 1000)
        before = optimizer.arrays()
        X, y = random_beams(50, 60)
        y[7] = 1e200
        with pytest.raises(NotFinite, match="not finite"):
            optimizer.step(X, y, 1000)
        for name, array in optimizer.arrays().items():
            np.testing.assert_array_equal(array, before[name], err_msg=name)


def test_learns_in_a_third_of_adams_steps():
    rng = np.random.default_rng(0)
    xy = rng.uniform(-15.0, 15.0, (6000, 2))
    z = np.sin(xy[:, 0] / 4.0) + np.cos(xy[:, 1] / 5.0) - 30.0
    beams = np.column_stack([xy, z + 0.1 * rng.standard_normal(6000)]).astype(np.float32)
    errors = {}
    for optimizer, steps in (("adam", 100), ("natgrad", 33)):
        config = SvgpConfig(inducing_points=64, minibatch_size=200, optimizer=optimizer)
        engine, rng = MinibatchSvgp(config, AREA), np.random.default_rng(1)
        for _ in range(steps):
            engine.train_step(beams[rng.integers(0, 5000, 200)], 5000)
        errors[optimizer] = np.std(engine.predict(beams[5000:, :2])[0] - z[5000:])
        assert engine.skipped_steps == 0
    # Measured: 0.077 m and 0.066 m, of a relief of 1 m.
    assert errors["natgrad"] < errors["adam"]


def test_calibrated_on_data_from_the_prior():
    truth = {"lengthscale_m": 8.0, "outputscale_m2": 2.0, "noise_std_m": 0.3}
    inside = []
    for seed in range(4):
        beams = gp_sample(1600, seed, 30.0, **truth)
        config = SvgpConfig(
            inducing_points=225,
            minibatch_size=300,
            optimizer="natgrad",
            learn_inducing_points=False,
            learn_hyperparameters=False,
            **truth,
        )
        engine, rng = MinibatchSvgp(config, AREA), np.random.default_rng(seed)
        for _ in range(150):
            batch = beams[rng.integers(0, 1400, 300)].astype(np.float32)
            engine.train_step(batch, 1400)
        mean, variance = engine.predict(beams[1400:, :2])
        half = 1.96 * np.sqrt(variance + truth["noise_std_m"] ** 2)
        inside.append(np.abs(beams[1400:, 2] - mean) < half)
    # 800 beams: a standard error of 0.8 %, were they independent.
    assert 0.93 < np.mean(inside) < 0.97


def test_double_precision_is_needed_for_the_precision_matrix():
    # 12 million beams of σ = 0.02 m over half of the area, as single precision would have it.
    theta = random_parameters(60, 1, extent_m=30.0)
    theta.set_hyperparameters(20.0, 1.0, 0.02**2)
    X = random_beams(1000, 2, 30.0)[0]
    X[:, 0] = X[:, 0].abs()
    K = covariance("matern52", theta.Z, theta.Z, 20.0, 1.0) + 1e-4 * torch.eye(60, dtype=DOUBLE)
    L = torch.linalg.cholesky(K)
    A = torch.linalg.solve_triangular(L, covariance("matern52", theta.Z, X, 20.0, 1.0), upper=False)
    factor = 12e6 / (1000 * 0.02**2)
    for dtype, works in ((torch.float32, False), (DOUBLE, True)):
        G = linalg.gram(A.to(dtype), torch.zeros(60, 60, dtype=dtype))
        Lambda = G * factor + torch.eye(60, dtype=dtype)
        info = torch.linalg.cholesky_ex(Lambda)[1].item()
        assert (info == 0) == works


@pytest.mark.parametrize("height", [0.05, 1.0, 30.0])
def test_learns_relief_of_any_height(height):
    rng = np.random.default_rng(0)
    xy = rng.uniform(-15.0, 15.0, (6000, 2))
    z = height * (np.sin(xy[:, 0] / 4.0) + np.cos(xy[:, 1] / 5.0) + 0.1 * rng.standard_normal(6000))
    beams = np.column_stack([xy, z]).astype(np.float32)
    config = SvgpConfig(inducing_points=64, minibatch_size=200, optimizer="natgrad")
    engine, rng = MinibatchSvgp(config, AREA), np.random.default_rng(1)
    for _ in range(60):
        engine.train_step(beams[rng.integers(0, 5000, 200)], 5000)
    error = np.std(engine.predict(beams[5000:, :2])[0] - beams[5000:, 2])
    # The relief's standard deviation is 1, the beams' noise 0.1; measured: 0.12.
    assert error < 0.14 * height


def test_a_precision_that_is_not_positive_is_told():
    with pytest.raises(linalg.NotPositiveDefinite, match="precision of q"):
        moments(-torch.eye(3, dtype=DOUBLE), torch.ones(3, dtype=DOUBLE), 2.0, DOUBLE)
