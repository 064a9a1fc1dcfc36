"""Loop closures against ground truth: relative poses by hand, and who is called wrong."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

from rbpf_svgp_slam.metrics.closure_metrics import (
    WRONG_ABOVE,
    closure_errors,
    closure_metrics,
)
from rbpf_svgp_slam.run.closures import Closures
from rbpf_svgp_slam.run.planar_poses import relative_pose

STAMP_S = np.arange(101.0)
SIGMA = np.array([0.1, 0.2, 0.01])  # m, m, rad


def circle():
    """Poses [101, 6] once around a circle of 50 m, so that the yaw goes through ±π."""
    angle = 2 * np.pi * STAMP_S / 100
    poses = np.zeros((len(angle), 6))
    poses[:, 0], poses[:, 1] = 50 * np.cos(angle), 50 * np.sin(angle)
    poses[:, 5] = (angle + np.pi / 2 + np.pi) % (2 * np.pi) - np.pi
    return poses


def closures_between(older, younger, off, verdict="accepted", sigma=SIGMA):
    """Closures of the pings [C] by number, off by [C, 3] from the truth."""
    track = circle()[:, [0, 1, 5]]
    count = len(older)
    return Closures(
        stamp=STAMP_S[younger],
        stamp_older=STAMP_S[older],
        relative=relative_pose(track[older], track[younger]) + off,
        covariance=np.tile([sigma[0] ** 2, 0, 0, sigma[1] ** 2, 0, sigma[2] ** 2], (count, 1)),
        shift=np.zeros((count, 3)),
        rms_m=np.full(count, 0.1),
        beams=np.full(count, 500),
        weight=np.ones(count),
        verdict=np.full(count, verdict),
    )


def concatenated(*parts):
    return Closures(
        **{name: np.concatenate([getattr(p, name) for p in parts]) for name in vars(parts[0])}
    )


def test_a_relative_pose_is_seen_from_the_older_one():
    # Heading north at (10, 20); the other is 3 m north and 4 m west of it, heading south.
    older, younger = np.array([[10.0, 20.0, np.pi / 2]]), np.array([[6.0, 23.0, -np.pi / 2]])
    [[forward, left, yaw]] = relative_pose(older, younger)
    assert (forward, left) == (pytest.approx(3.0), pytest.approx(4.0))
    assert abs(yaw) == pytest.approx(np.pi)


def test_errors_by_hand_and_the_yaw_s_on_the_circle():
    off = np.array([[0.3, -0.4, 0.02], [0.0, 0.0, 2 * np.pi]])
    error, squares = closure_errors(closures_between([0, 10], [60, 45], off), STAMP_S, circle())
    np.testing.assert_allclose(error, [[0.3, -0.4, 0.02], [0, 0, 0]], atol=1e-12)
    # (0.3 / 0.1)² + (0.4 / 0.2)² + (0.02 / 0.01)²
    np.testing.assert_allclose(squares, [17.0, 0.0], atol=1e-9)


def test_between_two_pings_the_truth_is_interpolated_but_not_over_a_gap():
    one = closures_between([0, 30], [60, 80], np.zeros((2, 3)))
    one.stamp += 0.5
    error, _ = closure_errors(one, STAMP_S, circle())
    # Half a step of 3.1 m further, along the chord.
    assert np.hypot(*error[0, :2]) == pytest.approx(np.pi / 2, rel=1e-2)
    truth = circle()
    truth[78:84] = np.nan
    error, squares = closure_errors(one, STAMP_S, truth)
    assert np.isfinite(squares).tolist() == [True, False]
    assert np.isfinite(error).all(axis=1).tolist() == [True, False]


def test_the_report_s_numbers_by_hand():
    good = closures_between([0, 1, 2], [50, 51, 52], np.outer([1.0, 2.0, 3.0], [0.1, 0, 0]))
    wrong = closures_between([3], [53], np.array([[0.0, 3.0, 0.0]]))
    flat = closures_between([4, 5], [54, 55], np.full((2, 3), 9.0), "flat")
    bad_fit = closures_between([6], [56], np.zeros((1, 3)), "bad_fit")
    notes = []
    found = closure_metrics(concatenated(good, wrong, flat, bad_fit), STAMP_S, circle(), notes)
    assert found["closures_accepted"] == 4
    assert found["closures_refused"] == {"flat": 2, "bad_fit": 1}
    assert found["closures_wrong"] == 1 and found["closures_wrong_share"] == 0.25
    # Of 0.1, 0.2, 0.3 and 3 m, and of 1, 4, 9 and 225: between the two in the middle.
    assert found["closure_error_median_m"] == pytest.approx(0.25)
    assert found["closure_nees"] == pytest.approx(6.5 / 3)
    assert len(found["closures"]) == 7 and found["closures"][3]["verdict"] == "accepted"
    assert found["closures"][0].keys() == vars(good).keys()
    assert notes == []


def test_what_cannot_be_judged_is_no_wrong_one():
    closures = closures_between([0, 1], [50, 51], np.zeros((2, 3)))
    closures.covariance[0] = 0.0
    notes = []
    found = closure_metrics(closures, STAMP_S, circle(), notes)
    assert found["closures_wrong"] == 0 and found["closures_wrong_share"] == 0.0
    assert notes[0].startswith("1 of 2 accepted closures cannot be judged")
    blind = closure_metrics(closures, STAMP_S, np.full((101, 6), np.nan), [])
    assert blind["closures_accepted"] == 2 and blind["closures_wrong"] is None
    assert set(closure_metrics(None, STAMP_S, circle(), []).values()) == {None}


def test_one_in_370_of_honest_closures_is_called_wrong():
    """Which is what 3 σ of a Gaussian leave; their median is that of χ² too."""
    assert chi2.ppf(0.9973, 3) == pytest.approx(WRONG_ABOVE, abs=0.005)
    rng = np.random.default_rng(0)
    n = 20_000
    older, younger = rng.integers(0, 101, (2, n))
    off = SIGMA * rng.standard_normal((n, 3))
    found = closure_metrics(closures_between(older, younger, off), STAMP_S, circle(), [])
    # A share of 0.0027 of n has a standard error of 0.00037; four are allowed.
    assert found["closures_wrong_share"] == pytest.approx(0.0027, abs=0.0015)
    # The median's standard error is 1 / (2 √n f), f = 0.23 the density there: 0.015, over 3.
    assert found["closure_nees"] == pytest.approx(chi2.median(3) / 3, abs=4 * 0.005)


def test_closures_are_made_of_messages():
    message = SimpleNamespace(
        stamp=2.0,
        stamp_older=1.0,
        relative=(1.0, 2.0, 3.0),
        covariance=(1.0,) * 6,
        shift=[0.0] * 3,
        rms_m=0.1,
        beams=7,
        weight=float("nan"),
        verdict="flat",
    )
    two = Closures.of([message, message])
    assert two.relative.shape == (2, 3) and two.beams.tolist() == [7, 7]
    assert not two.accepted.any() and two.rows()[1]["verdict"] == "flat"
    assert len(Closures.of([]).accepted) == 0 and Closures.of([]).rows() == []
    with pytest.raises(ValueError, match="closures' rms_m: expected shape"):
        dataclasses.replace(two, rms_m=np.zeros(3))
