"""The SVGP as a map engine: training, prediction, robustness."""

import logging
import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from svgp_reference import DOUBLE, dense_elbo, gp_sample, leaf, set_optimal_q

from rbpf_svgp_slam.maps import MinibatchMap, group_class
from rbpf_svgp_slam.svgp.config import SvgpConfig
from rbpf_svgp_slam.svgp.group import SvgpGroup
from rbpf_svgp_slam.svgp.minibatch_svgp import MinibatchSvgp
from rbpf_svgp_slam.svgp.parameters import Parameters

AREA = [[-15.0, -15.0], [15.0, -15.0], [15.0, 15.0], [-15.0, 15.0]]
SMALL = SvgpConfig(inducing_points=64, minibatch_size=200, optimizer="adam")


def terrain(n=5000, seed=0, depth_m=30.0):
    """Beams [n, 3] float32 over AREA: two waves and noise of 0.1 m."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-15.0, 15.0, (n, 2))
    z = np.sin(xy[:, 0] / 4.0) + np.cos(xy[:, 1] / 5.0) - depth_m
    return np.column_stack([xy, z + 0.1 * rng.standard_normal(n)]).astype(np.float32)


def train(engine, beams, steps, seed=1):
    rng = np.random.default_rng(seed)
    for _ in range(steps):
        batch = beams[rng.integers(0, len(beams), engine.config.minibatch_size)]
        engine.train_step(batch, len(beams))
    return engine


def test_interface():
    assert group_class("svgp") is SvgpGroup
    assert issubclass(MinibatchSvgp, MinibatchMap)
    engine = MinibatchSvgp(SMALL, AREA)
    assert (engine.iterations, engine.skipped_steps, engine.ready) == (0, 0, False)
    assert math.isnan(engine.objective)
    assert engine.noise_variance_m2 == pytest.approx(SMALL.noise_std_m**2, rel=1e-5)
    train(engine, terrain(), 3)
    assert engine.iterations == 3
    assert math.isfinite(engine.objective)
    assert engine.support_points().shape == (64, 3)


def test_untrained_map_is_the_prior():
    engine = MinibatchSvgp(SMALL, AREA)
    mean, variance = engine.predict(np.array([[0.0, 0.0], [5.0, 500.0]]))
    np.testing.assert_array_equal(mean, 0.0)
    # R = I: exactly the prior, up to single precision
    np.testing.assert_allclose(variance, SMALL.outputscale_m2, rtol=1e-5)
    assert engine.prior_variance_m2 == pytest.approx(SMALL.outputscale_m2, rel=1e-5)


def test_one_inducing_point_decays_with_the_default_kernel():
    config = SvgpConfig(
        inducing_points=1,
        optimizer="adam",
        lengthscale_m=4.0,
        learn_hyperparameters=False,
        learn_inducing_points=False,
    )
    engine = train(MinibatchSvgp(config, AREA), terrain(), 20)
    at, near, away = engine.predict(np.array([[0.0, 0.0], [3.0, 4.0], [1000.0, 0.0]]))[0]
    # f(x) − c ∝ k(x, z) = o·exp(−r/ℓ), with r = 5 m; the mean is −30 m, in single precision
    assert (near - away) / (at - away) == pytest.approx(math.exp(-5.0 / 4.0), rel=1e-4)


def test_learns_terrain_to_a_fraction_of_its_relief():
    engine = train(MinibatchSvgp(SMALL, AREA), terrain(), 400)
    truth = terrain(2000, seed=5)
    mean, variance = engine.predict(truth[:, :2])
    # Relief of 1 m; what is left is the beams' noise of 0.1 m and what lies between 64 points.
    assert math.sqrt(np.mean((mean - truth[:, 2]) ** 2)) < 0.17
    assert np.all(variance >= 0.0)
    # Between inducing points half a lengthscale apart much of the prior's variance remains.
    assert np.mean(variance) < 0.5 * engine.prior_variance_m2
    far = engine.predict(np.array([[1e4, 1e4]]))[1][0]
    assert far == pytest.approx(engine.prior_variance_m2, rel=1e-5)


def test_fit_reaches_the_best_bound_for_the_true_hyperparameters():
    truth = {"lengthscale_m": 8.0, "outputscale_m2": 2.0, "noise_std_m": 0.3}
    beams = gp_sample(1500, 2, 30.0, **truth)
    config = replace(SMALL, inducing_points=100, minibatch_size=300)
    engine = train(MinibatchSvgp(config, AREA), beams.astype(np.float32), 800)
    X, z = torch.from_numpy(beams[:, :2].copy()), torch.from_numpy(beams[:, 2].copy())

    best = Parameters(100, DOUBLE, "cpu")
    best.Z.copy_(MinibatchSvgp(config, AREA).optimizer.theta.Z)
    best.set_hyperparameters(8.0, 2.0, 0.09)
    best.c.fill_(-30.0)
    set_optimal_q(best, X, z, "matern12", config.jitter)
    bound = dense_elbo(leaf(best), X, z, len(z), "matern12", config.jitter).item()

    theta = Parameters(100, DOUBLE, "cpu")
    theta.flat.copy_(engine.optimizer.theta.flat)
    reached = dense_elbo(
        leaf(theta), X, z - engine.optimizer.reference_m, len(z), "matern12", config.jitter
    )
    # Learned inducing points and noise do better than the truth's; Adam's own noise costs a little.
    assert reached.item() > bound - 0.02


@pytest.mark.parametrize("depth_m", [10.0, 3000.0])
def test_same_settings_at_any_depth(depth_m):
    shallow = train(MinibatchSvgp(SMALL, AREA), terrain(depth_m=0.0), 200)
    beams = terrain(depth_m=0.0)
    beams[:, 2] -= np.float32(depth_m)
    deep = train(MinibatchSvgp(SMALL, AREA), beams, 200)
    xy = terrain(300, seed=9)[:, :2]
    mean, variance = shallow.predict(xy)
    deep_mean, deep_variance = deep.predict(xy)
    # Depths of 3000 m come in steps of 0.2 mm, and Adam, whose first steps only take the
    # gradient's sign, amplifies rounding: a tenth of the beams' noise is let pass.
    assert np.std(deep_mean + depth_m - mean) < 0.01
    np.testing.assert_allclose(deep_variance.mean(), variance.mean(), rtol=0.02)


def test_beams_that_are_not_finite_are_refused():
    engine, beams = MinibatchSvgp(SMALL, AREA), terrain(200)
    beams[[3, 50], [0, 2]] = np.nan, np.inf
    with pytest.raises(ValueError, match="2 of 200 beams are not finite"):
        engine.train_step(beams, 200)
    assert engine.iterations == 0


@pytest.mark.parametrize(
    "beams, beams_in_log, message",
    [
        (np.zeros((5, 2)), 5, r"beams has shape \(5, 2\); expected \[n, 3\]"),
        (np.zeros((0, 3)), 5, r"beams has shape \(0, 3\)"),
        (np.zeros((5, 3)), 0, "beams_in_log is 0; expected at least 1"),
    ],
)
def test_malformed_input_is_refused(beams, beams_in_log, message):
    with pytest.raises(ValueError, match=message):
        MinibatchSvgp(SMALL, AREA).train_step(beams, beams_in_log)


@pytest.mark.parametrize("steps_before", [0, 5])
def test_a_step_that_is_not_finite_is_undone_and_counted(steps_before, caplog):
    engine, beams = MinibatchSvgp(SMALL, AREA), terrain()
    twin = MinibatchSvgp(SMALL, AREA)
    train(engine, beams, steps_before)
    train(twin, beams, steps_before)
    absurd = beams[:200].copy()
    absurd[0, 2] = 1e25  # finite, its square is not
    with caplog.at_level(logging.WARNING):
        engine.train_step(absurd, len(beams))
    assert "undone, 1 so far" in caplog.text
    assert (engine.iterations, engine.skipped_steps) == (steps_before, 1)
    # As if it had never been
    train(engine, beams, 3, seed=4)
    train(twin, beams, 3, seed=4)
    assert torch.equal(engine.optimizer.theta.flat, twin.optimizer.theta.flat)
    assert engine.objective == twin.objective


def test_outliers_leave_everything_finite():
    engine, beams = MinibatchSvgp(SMALL, AREA), terrain()
    beams[::50, 2] += 1e4
    train(engine, beams, 50)
    mean, variance = engine.predict(beams[:100, :2])
    assert np.isfinite([mean, variance]).all()


@pytest.mark.parametrize("kernel", ["matern12", "matern32", "matern52"])
def test_all_beams_at_one_place_leave_everything_finite(kernel):
    engine = MinibatchSvgp(replace(SMALL, kernel=kernel), AREA)
    beams = np.tile(np.float32([[1.0, 2.0, -30.0]]), (200, 1))
    for _ in range(30):
        engine.train_step(beams, 200)
    assert engine.skipped_steps == 0
    assert engine.predict(beams[:1, :2])[0][0] == pytest.approx(-30.0, abs=0.1)


def test_coinciding_inducing_points_raise_the_jitter_loudly(caplog):
    engine = MinibatchSvgp(replace(SMALL, inducing_points=5, jitter=1e-17), AREA)
    engine.optimizer.theta.Z.copy_(engine.optimizer.theta.Z[0].expand(5, 2).clone())
    train(engine, terrain(), 1)
    assert (engine.iterations, engine.skipped_steps) == (1, 0)
    assert engine.jitter_raises > 0
    assert "no Cholesky with jitter 1e-17" in caplog.text


def test_flags_keep_parameters_where_they_are():
    beams, initial = terrain(), MinibatchSvgp(SMALL, AREA).optimizer.theta
    for learn_Z in (False, True):
        config = replace(SMALL, learn_inducing_points=learn_Z, learn_hyperparameters=not learn_Z)
        theta = train(MinibatchSvgp(config, AREA), beams, 3).optimizer.theta
        assert torch.equal(theta.Z, initial.Z) != learn_Z
        assert torch.equal(theta.raw, initial.raw) == learn_Z
        assert torch.equal(theta.c, initial.c) == learn_Z
        assert not torch.equal(theta.m, initial.m)


def test_first_adam_step_is_the_learning_rate():
    config = replace(SMALL, learning_rate=0.05)
    initial, engine = MinibatchSvgp(config, AREA).optimizer.theta, train(
        MinibatchSvgp(config, AREA), terrain(), 1
    )
    # Adam's first step is rate·sign(gradient), but for ε
    moved = (engine.optimizer.theta.flat - initial.flat).abs()
    S = config.inducing_points
    torch.testing.assert_close(moved[:S], torch.full((S,), 0.05), rtol=1e-3, atol=0.0)
    torch.testing.assert_close(moved[S + S * S :].max(), torch.tensor(0.05), rtol=1e-3, atol=0.0)
    assert torch.equal(engine.optimizer.theta.R.triu(1), torch.zeros(S, S))


def test_maps_that_share_work_space_do_not_disturb_each_other():
    beams = [terrain(seed=1), terrain(seed=2)]
    alone = [train(MinibatchSvgp(SMALL, AREA), b, 4) for b in beams]
    together = [MinibatchSvgp(SMALL, AREA), MinibatchSvgp(SMALL, AREA)]
    generators = [np.random.default_rng(1), np.random.default_rng(1)]
    for _ in range(4):
        for engine, b, rng in zip(together, beams, generators):
            engine.train_step(b[rng.integers(0, len(b), 200)], len(b))
            engine.predict(b[:7, :2])
    for ours, theirs in zip(together, alone):
        assert torch.equal(ours.optimizer.theta.flat, theirs.optimizer.theta.flat)


def test_prediction_at_no_points():
    mean, variance = MinibatchSvgp(SMALL, AREA).predict(np.empty((0, 2)))
    assert mean.shape == variance.shape == (0,)


def test_prediction_follows_training():
    engine, beams = MinibatchSvgp(SMALL, AREA), terrain()
    before = engine.predict(beams[:5, :2])[0]
    train(engine, beams, 1)
    assert not np.allclose(engine.predict(beams[:5, :2])[0], before)


def test_minibatch_size_may_vary():
    engine, beams = MinibatchSvgp(SMALL, AREA), terrain()
    for size in (1, 200, 37, 200):
        engine.train_step(beams[:size], len(beams))
    assert engine.iterations == 4


@pytest.mark.skipif(torch.cuda.is_available(), reason="needs a machine without a GPU")
def test_cuda_without_a_gpu_is_refused():
    with pytest.raises(ValueError, match="device is 'cuda'; expected cpu"):
        MinibatchSvgp(replace(SMALL, device="cuda"), AREA)
