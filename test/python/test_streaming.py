"""Maps that take in every beam once, and maps that share their model."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from svgp_reference import random_beams, random_parameters, set_optimal_q

from rbpf_svgp_slam.maps import make_group
from rbpf_svgp_slam.svgp import linalg
from rbpf_svgp_slam.svgp.config import SvgpConfig
from rbpf_svgp_slam.svgp.minibatch_svgp import MinibatchSvgp
from rbpf_svgp_slam.svgp.optimizers.optimizer import NotFinite
from rbpf_svgp_slam.svgp.optimizers.streaming import FixedModel, Streaming
from rbpf_svgp_slam.svgp.streaming_svgp import StreamingSvgp

AREA = [[-15.0, -15.0], [15.0, -15.0], [15.0, 15.0], [-15.0, 15.0]]
JITTER = 1e-2
DOUBLE = SvgpConfig(inducing_points=25, optimizer="streaming", jitter=JITTER, dtype="float64")
SMALL = SvgpConfig(inducing_points=64, minibatch_size=200, optimizer="streaming")
SHARED = replace(SMALL, optimizer="natgrad", shared_hyperparameters=True, natgrad_model_period=10)

kernels = pytest.mark.parametrize("kernel", ["matern12", "matern32", "matern52"])


def streaming(theta, **changes):
    """A Streaming under the model of theta, without a beam."""
    config = replace(DOUBLE, **changes)
    optimizer = Streaming(config)
    optimizer.fixed = FixedModel(config, theta.model)
    return optimizer


def assert_optimal(optimizer, theta, X, y, kernel="matern12"):
    set_optimal_q(theta, X, y, kernel, JITTER)
    q = optimizer.gaussian()
    # Rounding in double precision, of matrices with a condition of up to S/JITTER.
    torch.testing.assert_close(q.m, theta.m, rtol=1e-8, atol=1e-9)
    torch.testing.assert_close(q.factor.T @ q.factor, theta.R @ theta.R.T, rtol=1e-8, atol=1e-9)


def terrain(n, seed=0):
    """Beams [n, 3] float32 over AREA: two waves and noise of 0.1 m."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-15.0, 15.0, (n, 2))
    z = np.sin(xy[:, 0] / 4.0) + np.cos(xy[:, 1] / 5.0) - 30.0
    return np.column_stack([xy, z + 0.1 * rng.standard_normal(n)]).astype(np.float32)


def group_for(config):
    parameters = SimpleNamespace(
        map=SimpleNamespace(engine="svgp"), survey_area=AREA, engine_group=config.as_dict()
    )
    return make_group(parameters)


def train(engine, beams, steps, seed=1):
    rng = np.random.default_rng(seed)
    for _ in range(steps):
        engine.train_step(beams[rng.integers(0, len(beams), 200)], len(beams))


@kernels
def test_every_beam_folded_in_once_gives_the_optimum(kernel):
    theta, (X, y) = random_parameters(25, 3), random_beams(2500, 3)
    optimizer = streaming(theta, kernel=kernel)
    for start, end in ((0, 1), (1, 600), (600, 2500)):  # one block is longer than the work space's
        assert optimizer.next_beam == start
        optimizer.fold(X[start:end], y[start:end])
    assert optimizer.next_beam == 2500
    assert_optimal(optimizer, theta, X, y, kernel)


def test_rebuilding_is_folding_under_the_new_model():
    theta, other = random_parameters(25, 3), random_parameters(25, 4)
    X, y = random_beams(800, 3)
    optimizer = streaming(theta)
    optimizer.fold(X, y)
    optimizer.rebuild(FixedModel(optimizer.config, other.model), X, y, len(y))
    assert optimizer.next_beam == 800
    more_X, more_y = random_beams(50, 9)
    optimizer.fold(more_X, more_y)
    assert_optimal(optimizer, other, torch.cat([X, more_X]), torch.cat([y, more_y]))


def test_a_sample_stands_for_the_whole_log():
    theta, (X, y) = random_parameters(25, 3), random_beams(100, 3)
    optimizer = streaming(theta)
    optimizer.rebuild(optimizer.fixed, X, y, 300)
    assert optimizer.next_beam == 300
    assert_optimal(optimizer, theta, X.repeat(3, 1), y.repeat(3))


def test_beams_that_are_not_finite_change_nothing():
    theta, (X, y) = random_parameters(25, 3), random_beams(100, 3)
    optimizer = streaming(theta)
    optimizer.fold(X, y)
    before = optimizer.arrays()
    bad = y.clone()
    bad[3] = 1e200
    other = FixedModel(optimizer.config, random_parameters(25, 4).model)
    for attempt in (
        lambda: optimizer.fold(X, bad),
        lambda: optimizer.rebuild(other, X, bad, 100),
    ):
        with pytest.raises(NotFinite):
            attempt()
        for name, array in optimizer.arrays().items():
            np.testing.assert_array_equal(array, before[name], err_msg=name)


def test_a_streaming_map_refuses_minibatches_and_others_refuse_to_stream():
    with pytest.raises(TypeError, match="takes in the log's beams in their order"):
        MinibatchSvgp(SMALL, AREA).train_step(terrain(5), 5)
    learning = replace(SMALL, optimizer="natgrad")
    assert getattr(MinibatchSvgp(learning, AREA), "next_beam", None) is None
    with pytest.raises(TypeError, match="learns from minibatches"):
        StreamingSvgp(learning, AREA).take_in(terrain(5))


def test_a_node_of_streaming_maps():
    group, beams = group_for(SMALL), terrain(20000)
    one, other = group.create(), group.create()
    train(group.teacher, beams, 60)
    assert one.outdated
    one.rebuild(beams[:3000], 3000)
    other.rebuild(beams[:3000], 3000)
    assert not one.outdated
    assert one.optimizer.fixed is other.optimizer.fixed  # L is computed once
    for start in range(3000, 20000, 1000):
        one.take_in(beams[start : start + 1000])
    assert (one.next_beam, other.next_beam) == (20000, 3000)
    truth = terrain(2000, seed=5)

    def rmse(engine):
        return np.sqrt(np.mean((engine.predict(truth[:, :2])[0] - truth[:, 2]) ** 2))

    # The beams' noise is 0.1 m.
    assert rmse(one) < min(0.115, rmse(other))
    assert rmse(one) < 1.01 * rmse(group.teacher)
    # Readiness is the teacher's, and travels with a copy that stands alone.
    train(group.teacher, beams, 300)
    assert group.teacher.ready and one.ready
    assert one.objective == group.teacher.objective
    copy = group.load_alone(one.to_bytes())
    assert copy.ready and not copy.outdated
    np.testing.assert_array_equal(copy.predict(truth[:9, :2]), one.predict(truth[:9, :2]))
    # One of the same node follows the same teacher, and shares what the others share.
    assert one.outdated and group.load(one.to_bytes()).outdated
    one.rebuild(beams, len(beams))
    assert group.load(one.to_bytes()).optimizer.fixed is one.optimizer.fixed


def test_copies_share_what_the_node_shares():
    for config in (SMALL, SHARED):
        group, beams = group_for(config), terrain(3000)
        engine = group.create()
        if group.teacher:
            train(group.teacher, beams, 20)
            engine.rebuild(beams, len(beams))
        else:
            train(engine, beams, 20)
        copy = engine.copy()
        assert copy.optimizer.model is engine.optimizer.model
        assert copy.common is engine.common
        np.testing.assert_array_equal(copy.predict(beams[:9, :2]), engine.predict(beams[:9, :2]))
        assert not getattr(copy, "outdated", False)  # only streaming maps can be


def test_while_it_is_rebuilt_a_map_is_what_it_was():
    group, beams = group_for(SMALL), terrain(4000)
    engine, pauses = group.create(), []
    engine.take_in(beams[:500])  # under the first model, and with a reference of its own
    train(group.teacher, beams, 20)
    before, prediction = engine.to_bytes(), engine.predict(beams[:9, :2])

    def look():
        pauses.append(engine.to_bytes() == before)
        np.testing.assert_array_equal(engine.predict(beams[:9, :2]), prediction)

    def give_up():
        raise InterruptedError

    with pytest.raises(InterruptedError):
        engine.rebuild(beams, len(beams), give_up)
    assert engine.to_bytes() == before and engine.outdated
    engine.rebuild(beams, len(beams), look)
    assert pauses == 4 * [True]  # after each block of 1024
    assert not engine.outdated
    whole = group.create()
    whole.rebuild(beams, len(beams))
    np.testing.assert_array_equal(engine.predict(beams[:9, :2]), whole.predict(beams[:9, :2]))


def test_a_rebuild_from_a_sample_costs_less_than_two_percent():
    beams, truth = terrain(60000), terrain(3000, seed=5)
    truth[:, 2] = np.sin(truth[:, 0] / 4.0) + np.cos(truth[:, 1] / 5.0) - 30.0
    group = group_for(SMALL)
    train(group.teacher, beams, 100)
    errors = []
    for sample in (60000, 100 * SMALL.inducing_points):
        engine = group.create()
        engine.rebuild(beams[:sample], len(beams))
        errors.append(np.std(engine.predict(truth[:, :2])[0] - truth[:, 2]))
    # Without the noise of the test beams, which would hide it: σ²·S/n = 1 % of the noise variance.
    noise = np.sqrt(group.teacher.noise_variance_m2)
    assert np.hypot(errors[1], noise) < 1.02 * np.hypot(errors[0], noise)


# One model for a node's maps


def test_maps_that_share_their_model_factorise_it_once(monkeypatch):
    group, beams, calls = group_for(SHARED), terrain(5000), []
    cholesky = linalg.cholesky
    monkeypatch.setattr(linalg, "cholesky", lambda *args: calls.append(1) or cholesky(*args))
    maps, rng = [group.create() for _ in range(5)], np.random.default_rng(0)
    for _ in range(60):
        for engine in maps:
            engine.train_step(beams[rng.integers(0, 5000, 200)], 5000)
    # 300 steps, of which every tenth changed the model for all
    assert len(calls) == 30
    truth = terrain(1000, seed=3)
    means = [engine.predict(truth[:, :2])[0] for engine in maps]
    for mean in means:
        assert np.sqrt(np.mean((mean - truth[:, 2]) ** 2)) < 0.2
    assert not np.allclose(means[0], means[1])  # each has its own q(v)


def test_predictions_follow_a_model_that_another_map_has_moved():
    group, beams = group_for(replace(SHARED, natgrad_model_period=1)), terrain(5000)
    one, other = group.create(), group.create()
    train(one, beams, 5)
    before = one.predict(beams[:5, :2])[0]
    train(other, beams, 5)
    after = one.predict(beams[:5, :2])[0]
    assert not np.array_equal(before, after)
    # as a copy with the model of that moment, which then is left alone
    alone = group.load_alone(one.to_bytes())
    np.testing.assert_array_equal(alone.predict(beams[:5, :2])[0], after)
    train(other, beams, 5)
    np.testing.assert_array_equal(alone.predict(beams[:5, :2])[0], after)


def test_a_map_from_another_node_takes_over_this_nodes_model():
    here, there, beams = group_for(SHARED), group_for(SHARED), terrain(5000)
    local, remote = here.create(), there.create()
    train(local, beams, 200, seed=1)
    train(remote, beams, 200, seed=2)
    arrived = here.load(remote.to_bytes())
    assert arrived.optimizer.model is local.optimizer.model
    truth = terrain(1000, seed=3)

    def rmse(engine):
        return np.sqrt(np.mean((engine.predict(truth[:, :2])[0] - truth[:, 2]) ** 2))

    # What it learned under another model is expressed under this one, and not lost.
    assert rmse(arrived) < 1.2 * rmse(remote)
    train(arrived, beams, 30)
    assert rmse(arrived) < 1.05 * rmse(remote)
