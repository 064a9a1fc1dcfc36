"""The yardstick: dense least squares beside the graph, and what must come of a known survey."""

import dataclasses

import numpy as np
import pytest
from made_up_survey import make_run

from rbpf_svgp_slam.metrics.ideal_metrics import DRAWS, ideal_metrics
from rbpf_svgp_slam.metrics.trajectory_errors import ate_rmse
from rbpf_svgp_slam.smoothing import ideal as yardstick
from rbpf_svgp_slam.smoothing.ideal import IdealTrack, ideal
from rbpf_svgp_slam.smoothing.smoothing_parameters import smoothing_params

NOISE = {"surge_std_m": 0.1, "sway_std_m": 0.1, "yaw_std_rad": 1e-5}
NO_BIAS = {"velocity_bias_std_mps": 0.0, "yaw_bias_std_radps": 0.0}


def to_and_fro():
    """Stamps [81] and poses [81, 3] out along x and back again, without a turn."""
    x = np.concatenate([np.arange(41.0), np.arange(39.0, -1, -1)])
    return 2.0 * np.arange(81), np.column_stack([x, 0 * x, 0 * x])


def test_it_is_the_least_squares_of_its_increments_and_closures(monkeypatch):
    """Headings are known, so that x and y are linear; and errors too small for a robust kernel."""
    monkeypatch.setattr(yardstick, "ERROR", np.array([0.1, 0.1, 1e-4]))
    stamp_s, truth = to_and_fro()
    rng = np.random.default_rng(3)
    drift = np.cumsum(0.1 * np.sqrt(2.0) * rng.standard_normal((81, 2)), axis=0)
    odometry = truth + np.column_stack([drift - drift[0], np.zeros(81)])
    added = []
    track = IdealTrack(
        smoothing_params({"motion": NOISE, "smoothing": NO_BIAS}), stamp_s, odometry, truth
    )
    close = track._graph.add_closure

    class Graph:
        def __getattr__(self, name):
            return getattr(graph, name)

        def add_closure(self, k, j, relative, covariance):
            added.append((k, j, relative))
            return close(k, j, relative, covariance)

    graph, track._graph = track._graph, Graph()
    count = track.run(np.full(81, 3.0))
    assert count == len(added) > 60
    rows, values = [np.eye(81)[0] / 1e-3], [odometry[0, 0] / 1e-3]
    for j in range(1, 81):
        rows.append((np.eye(81)[j] - np.eye(81)[j - 1]) / (0.1 * np.sqrt(2.0)))
        values.append((odometry[j, 0] - odometry[j - 1, 0]) / (0.1 * np.sqrt(2.0)))
    # The kernel's weights, 1 / (1 + chi^2 / 6), by iteration, y and yaw included.
    for k, j, relative in added:
        e = (relative - (track.smoothed[j] - track.smoothed[k])) / yardstick.ERROR
        root_weight = (1 + e @ e / 6) ** -0.5
        rows.append(root_weight * (np.eye(81)[j] - np.eye(81)[k]) / 0.1)
        values.append(root_weight * relative[0] / 0.1)
    expected = np.linalg.lstsq(np.array(rows), np.array(values), rcond=None)[0]
    # The solver stops where the cost changes by less than 1e-5 of itself.
    np.testing.assert_allclose(track.smoothed[:, 0], expected, rtol=0, atol=0.01)


def test_what_comes_before_an_overlap_is_as_dead_reckoning_has_it():
    stamp_s, truth = to_and_fro()
    odometry = truth + np.column_stack([0 * stamp_s, 0.02 * stamp_s, 0 * stamp_s])
    track = IdealTrack(smoothing_params({"motion": NOISE}), stamp_s, odometry, truth)
    track.run(np.full(81, 3.0))
    # Nothing is 60 s older and within 3 m before the way back has begun and lasts 30 s.
    np.testing.assert_allclose(track.online[:50], odometry[:50], atol=1e-6)
    assert abs(track.online[-1, 1]) < 0.5 < odometry[-1, 1]
    # All of the past is known later, but for the far end, where the track turned.
    assert np.abs(track.smoothed[:20, 1]).max() < 0.25 < odometry[20, 1]


def test_without_overlap_it_is_dead_reckoning():
    stamp_s, truth = to_and_fro()
    odometry = truth + np.column_stack([0 * stamp_s, 0.02 * stamp_s, 0 * stamp_s])
    track = IdealTrack(smoothing_params({}), stamp_s, odometry, truth)
    assert track.run(np.zeros(81)) == 0
    np.testing.assert_allclose(track.smoothed, odometry, atol=1e-6)


@pytest.mark.parametrize("apart_m, is_seen", [(4.4, True), (4.6, False)])
def test_lines_tell_of_each_other_as_far_as_the_smoother_registers_them(apart_m, is_seen):
    stamp_s, truth = to_and_fro()
    truth[41:, 1] = apart_m  # half widths of 3 m: three quarters of both are 4.5 m
    track = IdealTrack(smoothing_params({}), stamp_s, truth, truth)
    assert (track.run(np.full(81, 3.0)) > 0) == is_seen


@pytest.fixture(scope="module")
def tracks(run):
    return ideal(run, smoothing_params(run.config))


def test_a_survey_is_known_far_better_than_its_dead_reckoning(run, tracks):
    spacing_s = np.diff(run.stamp_s[np.isin(run.ground_truth, tracks.truth).all(axis=1)])
    assert spacing_s.min() == pytest.approx(2.0)
    dr = ate_rmse(run.dead_reckoning, run.ground_truth)
    smoothed, online = (ate_rmse(t, tracks.truth) for t in (tracks.smoothed, tracks.online))
    assert smoothed < 0.2 * dr
    assert smoothed < online < dr
    np.testing.assert_array_equal(tracks.smoothed[:, 2:5], tracks.online[:, 2:5])


def test_the_same_survey_gives_the_same_numbers(tracks):
    again = make_run()
    again = ideal(again, smoothing_params(again.config))
    np.testing.assert_array_equal(again.smoothed, tracks.smoothed)


def test_the_report_has_the_root_mean_square_of_several_draws(run):
    params = smoothing_params(run.config)
    draws = [ideal(run, params, seed) for seed in range(DRAWS)]
    errors_m = [ate_rmse(one.smoothed, one.truth) for one in draws]
    assert len(set(errors_m)) == DRAWS, "each draw is one of its own"
    reported_m = ideal_metrics(run, [])["ideal_ate_rmse_m"]
    assert min(errors_m) < reported_m < max(errors_m)
    assert reported_m**2 == pytest.approx(np.mean(np.square(errors_m)))


def test_where_it_cannot_be_known(run):
    assert ideal(dataclasses.replace(run, ground_truth=None), smoothing_params({})) is None
    unknown = np.full_like(run.ground_truth, np.nan)
    assert ideal(dataclasses.replace(run, ground_truth=unknown), smoothing_params({})) is None
    notes = []
    odd = dataclasses.replace(run, config={"motion": {"surge_std_m": "wide"}})
    assert set(ideal_metrics(odd, notes).values()) == {None}
    expected = "parameters.yaml: motion/surge_std_m is 'wide'; expected a finite number from 0"
    assert notes[0].startswith(expected)


@pytest.mark.parametrize(
    "config, message",
    [
        ({"smoothing": {"passes": 1.5}}, "smoothing/passes is 1.5; expected an integer from 1"),
        ({"smoothing": {"window_s": 0}}, "smoothing/window_s is 0; expected a finite number from"),
        ({"start": {"yaw_std_rad": float("nan")}}, "start/yaw_std_rad is nan; expected"),
        ({"motion": {"sway_std_m": True}}, "motion/sway_std_m is True; expected"),
        ({"motion": 3}, "motion is 3; expected parameters by name"),
    ],
)
def test_parameters_that_are_no_smoothers_are_named(config, message):
    with pytest.raises(ValueError, match=message):
        smoothing_params(config)


def test_parameters_reach_the_smoother():
    config = {
        "motion": {"surge_std_m": 0.3},
        "start": {"position_std_m": 2},
        "smoothing": {"bias_time_s": 99.0, "passes": 2, "period_s": 30.0},
    }
    params = smoothing_params(config)
    assert params.motion.surge_std_m == 0.3 and params.start_position_std_m == 2.0
    assert params.bias_time_s == 99.0 and params.registration.passes == 2
    default = smoothing_params({})
    assert default.motion.sway_std_m == params.motion.sway_std_m
    assert default.registration.window_s == params.registration.window_s
