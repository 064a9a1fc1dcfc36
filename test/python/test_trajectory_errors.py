"""Errors of a track against closed forms, brute force, and the definition."""

import numpy as np
import pytest
from made_up_survey import ROUNDING_M, lawn_mower, random_tracks
from scipy import optimize
from scipy.spatial.transform import Rotation

from rbpf_svgp_slam.metrics import trajectory_errors as trajectory


def test_ate_of_a_shifted_track_is_the_shift_because_nothing_is_aligned():
    truth = lawn_mower()
    shifted = truth + [3.0, -4.0, 12.0, 0, 0, 0]
    assert trajectory.ate_rmse(shifted, truth) == pytest.approx(13.0, abs=ROUNDING_M)
    assert trajectory.final_error(shifted, truth) == pytest.approx(13.0, abs=ROUNDING_M)


def test_ate_counts_only_pings_with_ground_truth():
    truth = np.zeros((4, 6))
    truth[3] = np.nan
    poses = np.zeros((4, 6))
    poses[:, 0] = [0.0, 0.0, 3.0, 100.0]
    assert trajectory.ate_rmse(poses, truth) == pytest.approx(np.sqrt(3.0))
    assert trajectory.final_error(poses, truth) == pytest.approx(3.0)
    assert trajectory.ate_rmse(poses, np.full((4, 6), np.nan)) is None
    assert trajectory.final_error(poses, np.full((4, 6), np.nan)) is None


def test_aligned_ate_of_a_track_that_lies_askew_is_zero():
    truth = lawn_mower()
    turn = Rotation.from_euler("z", 0.3).as_matrix()
    askew = truth.copy()
    askew[:, :3] = truth[:, :3] @ turn.T + [30.0, -20.0, 2.0]
    assert trajectory.ate_rmse(askew, truth) > 1.0
    assert trajectory.ate_aligned_rmse(askew, truth) == pytest.approx(0, abs=ROUNDING_M)


def test_aligned_ate_is_the_least_that_a_rigid_motion_leaves():
    rng = np.random.default_rng(3)
    truth = lawn_mower()
    poses = truth + rng.normal(0, 2, truth.shape)
    least = trajectory.ate_aligned_rmse(poses, truth)

    def error(motion):
        moved = Rotation.from_rotvec(motion[:3]).apply(poses[:, :3]) + motion[3:]
        return np.sqrt(np.mean(np.sum((moved - truth[:, :3]) ** 2, axis=1)))

    # From no motion at all, the minimum is that near.
    found = optimize.minimize(error, np.zeros(6), method="BFGS").fun
    assert least == pytest.approx(found, rel=1e-6)
    assert least < trajectory.ate_rmse(poses, truth)


def test_aligned_ate_of_a_mirrored_track_is_not_zero():
    # A flat one could be turned over.
    truth = np.random.default_rng(4).normal(0, 20, (50, 6))
    mirrored = truth * [1, -1, 1, 1, 1, 1]
    assert trajectory.ate_aligned_rmse(mirrored, truth) > 1.0


def test_aligned_ate_of_a_straight_track(recwarn):
    truth, poses = np.zeros((2, 20, 6))
    truth[:, 0], poses[:, 1] = np.arange(20), np.arange(20)
    assert trajectory.ate_aligned_rmse(poses, truth) == pytest.approx(0, abs=ROUNDING_M)
    assert not recwarn.list


def test_aligned_ate_needs_three_known_poses():
    truth, poses = lawn_mower(), lawn_mower()
    truth[2:] = np.nan
    assert trajectory.ate_aligned_rmse(poses, truth) is None


def test_rpe_of_a_track_that_runs_too_fast_is_the_excess_over_the_interval():
    truth, poses = np.zeros((2, 50, 6))
    truth[:, 0], poses[:, 0] = np.arange(50) * 1.5, np.arange(50) * 1.6
    # At any attitude, as long as both have the same.
    for track in (truth, poses):
        track[:, 3:] = [0.1, -0.2, 2.0]
    assert trajectory.rpe_rmse(poses, truth, 7) == pytest.approx(0.7, abs=ROUNDING_M)
    # Where both start does not matter.
    assert trajectory.rpe_rmse(poses + [9, 9, 9, 0, 0, 0], truth, 7) == pytest.approx(0.7)


def test_rpe_of_a_turned_track_is_zero_because_only_motions_count():
    truth = lawn_mower()
    turned = truth.copy()
    turned[:, 0], turned[:, 1] = -truth[:, 1] + 30, truth[:, 0]
    turned[:, 5] += np.pi / 2
    assert trajectory.rpe_rmse(turned, truth, 40) == pytest.approx(0, abs=ROUNDING_M)


def brute_force_rpe(poses, truth, frames):
    """The definition, with 4 × 4 matrices, over the pairs whose four poses are known."""

    def matrix(pose):
        result = np.eye(4)
        result[:3, 3] = pose[:3]
        result[:3, :3] = Rotation.from_euler("ZYX", pose[:2:-1]).as_matrix()
        return result

    squared = []
    for i in range(len(poses) - frames):
        four = truth[i], truth[i + frames], poses[i], poses[i + frames]
        if np.isfinite(four).all():
            Q_i, Q_n, P_i, P_n = (matrix(pose) for pose in four)
            E = np.linalg.inv(np.linalg.inv(Q_i) @ Q_n) @ np.linalg.inv(P_i) @ P_n
            squared.append(E[:3, 3] @ E[:3, 3])
    return np.sqrt(np.mean(squared))


@pytest.mark.parametrize("frames", [1, 3, 58])
def test_rpe_equals_brute_force(frames):
    poses, truth = random_tracks(np.random.default_rng(5))
    expected = brute_force_rpe(poses, truth, frames)
    assert trajectory.rpe_rmse(poses, truth, frames) == pytest.approx(expected, abs=ROUNDING_M)


@pytest.mark.parametrize("frames", [None, 59, 60, 1000])
def test_rpe_is_unknown_where_no_pair_is_known(frames):
    # The last ping has no truth, so that 59 pings apart there is no pair either.
    poses, truth = random_tracks(np.random.default_rng(6))
    assert trajectory.rpe_rmse(poses, truth, frames) is None


def test_rpe_is_over_a_time_at_the_median_ping_period():
    stamp_s = np.arange(20) * 0.5
    stamp_s[10:] += 100.0  # a pause
    assert trajectory.rpe_frames(stamp_s, 60.0) == 120
    assert trajectory.rpe_frames(stamp_s, 0.1) == 1
    for no_period in (np.empty(0), np.zeros(1), np.zeros(3)):
        assert trajectory.rpe_frames(no_period, 60.0) is None
