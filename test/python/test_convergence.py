"""Convergence of the moving average: not fooled, lost and regained."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rbpf_svgp_slam.svgp.convergence import HYSTERESIS, MATURE_WEIGHT, Convergence


def run(values, decay=0.95, window=50, tolerance=0.1):
    """The states after each of the values, and the criterion itself."""
    convergence, ready = Convergence(decay, window, tolerance), []
    for value in values:
        convergence.update(float(value))
        ready.append(convergence.ready)
    return np.array(ready), convergence


def learning(steps, start=-20.0, end=0.5, time_constant=100.0):
    """An ELBO that approaches its end exponentially."""
    return end + (start - end) * np.exp(-np.arange(steps) / time_constant)


def test_average_has_no_bias_from_the_start():
    _, convergence = run([-3.0])
    assert convergence.average == -3.0
    _, convergence = run([-3.0, -1.0], decay=0.5)
    # (0.5·(−3) + 1·(−1))/1.5
    assert convergence.average == pytest.approx(-2.5 / 1.5, rel=1e-14)
    assert math.isnan(Convergence(0.9, 5, 0.1).average)


def test_converges_once_and_only_after_a_full_window():
    ready, _ = run(learning(1000))
    first = int(np.argmax(ready))
    assert 50 < first < 800
    assert ready[first:].all()
    ready, _ = run(np.zeros(120))
    # 1 − 0.95^45 = 0.9006 is the first mature weight; the window closes 50 steps later
    assert list(np.flatnonzero(np.diff(ready)) + 2) == [45 + 50]


@pytest.mark.parametrize("slope", [0.05, -0.05])
def test_neither_a_rising_nor_a_falling_objective_is_converged(slope):
    # 2.5 nats in each window, of an average of up to 7.5
    ready, _ = run(slope * np.arange(150))
    assert not ready.any()


def test_a_rising_loss_ends_readiness():
    values = np.concatenate([np.full(200, 1.0), 1.0 - 0.02 * np.arange(200)])
    ready, _ = run(values)
    assert ready[199]
    assert not ready[260:].any()


def test_lost_on_a_bump_and_regained():
    values = np.full(600, 0.4)
    values[300:] = 0.4 - 3.0 * np.exp(-np.arange(300) / 30.0)  # new relief comes in, is learned
    ready, _ = run(values)
    assert ready[299]
    assert not ready[305]
    assert ready[-1]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("noise", [0.02, 0.1])
def test_minibatch_noise_neither_starts_nor_ends_readiness(noise, seed):
    # Standard deviations of the minibatch ELBO seen on maps: 0.02, and 0.1 with outliers.
    rng = np.random.default_rng(seed)
    steady, _ = run(0.3 + noise * rng.standard_normal(3000))
    assert steady[100:].all()
    # three times the tolerance in each window
    learning_still, _ = run(0.006 * np.arange(300) - 1.0 + noise * rng.standard_normal(300))
    assert not learning_still.any()


@pytest.mark.parametrize("offset", [-2000.0, -1.0, 0.0, 1.0])
def test_tolerance_near_zero_and_far_from_it(offset):
    # Absolute below one nat, relative beyond
    change = 0.5 * 0.1 * max(1.0, abs(offset))
    slow, _ = run(offset + change * np.arange(300) / 50.0)
    fast, _ = run(offset + 5.0 * change * np.arange(100) / 50.0)
    assert slow[150:].all()
    assert not fast.any()


def test_an_objective_that_crosses_zero_stays_converged():
    # A ratio of averages would have a pole here.
    ready, _ = run(1e-3 * np.arange(-200.0, 200.0))
    assert ready[100:].all()


def test_hysteresis_keeps_a_map_near_the_tolerance_from_flickering():
    tolerated = 0.1 / 50.0  # per step
    near = 1.2 * tolerated * np.arange(300)
    ready, _ = run(np.concatenate([np.zeros(100), near]))
    assert ready[100:].all()
    ready, _ = run(np.concatenate([3.0 * tolerated * np.arange(-166, 0), near]))
    assert not ready.any()
    ready, _ = run(np.concatenate([np.zeros(100), HYSTERESIS * near]))
    assert not ready[200:].any()


def slow_reference(values, decay, window, tolerance):
    """Readiness after each value, every average summed up anew from all values so far."""
    averages, ready = [], []
    for n in range(1, len(values) + 1):
        weights = decay ** np.arange(n)[::-1]
        if (1.0 - decay) * weights.sum() > MATURE_WEIGHT:
            averages.append(weights @ values[:n] / weights.sum())
        change = math.inf
        if len(averages) > window:
            then, now = averages[-1 - window], averages[-1]
            change = abs(now - then) / max(1.0, abs(now))
        bound = tolerance * (HYSTERESIS if ready and ready[-1] else 1.0)
        ready.append(change < bound)
    return ready


@given(
    seed=st.integers(0, 10**6),
    decay=st.sampled_from([0.5, 0.9, 0.97]),
    window=st.integers(1, 40),
    tolerance=st.sampled_from([0.01, 0.1, 0.5]),
)
@settings(max_examples=40, deadline=None)
def test_equals_a_slow_reference(seed, decay, window, tolerance):
    rng = np.random.default_rng(seed)
    # Learned, disturbed by new relief, learned again; a falling stretch; noise as of minibatches.
    values = learning(250, start=rng.uniform(-30, -1), time_constant=rng.uniform(5, 60))
    bump = int(rng.integers(60, 200))
    values[bump:] -= rng.uniform(0, 4) * np.exp(-np.arange(250 - bump) / rng.uniform(5, 40))
    values[200:] -= rng.choice([0.0, 0.05]) * np.arange(50)
    values += 0.03 * rng.standard_normal(250)
    ready, _ = run(values, decay, window, tolerance)
    assert list(ready) == slow_reference(values, decay, window, tolerance)
