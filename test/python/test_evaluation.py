"""Evaluation against closed forms, brute force, and a made-up survey with known errors."""

import dataclasses
import itertools
import json
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import optimize
from scipy.spatial.transform import Rotation

from rbpf_svgp_slam.evaluation.report import write_run
from rbpf_svgp_slam.metrics import cells, map_metrics
from rbpf_svgp_slam.metrics import trajectory_errors as trajectory
from rbpf_svgp_slam.metrics.consistency import (
    ConsistencySettings,
    consistency,
    farthest_pass_distance,
    split_passes,
)
from rbpf_svgp_slam.metrics.evaluation import evaluate, json_ready
from rbpf_svgp_slam.run.survey_run import GridMap, SurveyRun
from rbpf_svgp_slam.run.tracks import interpolate_poses, read_tum, write_tum

CONTRACT = (
    "particles nodes seed pings pings_dropped beams duration_s wall_s real_time_factor "
    "iterations_total iterations_per_particle iterations_per_s loop_closure_prompts resamplings "
    "ate_rmse_m dr_ate_rmse_m ate_aligned_rmse_m dr_ate_aligned_rmse_m final_error_m "
    "dr_final_error_m rpe_rmse_m dr_rpe_rmse_m rpe_delta_s "
    "map_rmse_m map_msll "
    "consistency_rmse_m grid_rmse_m peak_rss_mb"
).split()
NOISE_M = 0.1
# Sums of doubles of order 100 m: a few thousand roundings of 1e-14 m.
ROUNDING_M = 1e-9


def seabed(xy):
    """Ripples and a mound, z in m [n] at xy [n, 2] m."""
    x, y = np.asarray(xy, dtype=float).T
    mound = 4 * np.exp(-((x - 60) ** 2 + (y - 25) ** 2) / 300)
    return -25 + mound + 0.7 * np.sin(x / 2.5) * np.cos(y / 3)


def lawn_mower(lines=6, length_m=100.0, spacing_m=10.0, step_m=0.75):
    """Poses [P, 6] every step_m along parallel lines joined by half circles, at z = -10 m."""
    pieces = []
    arc = np.linspace(-np.pi / 2, np.pi / 2, int(np.pi * spacing_m / 2 / step_m))[1:-1]
    radius_m = spacing_m / 2
    for i in range(lines):
        x = np.arange(0, length_m, step_m)
        straight = np.column_stack([x, np.full(len(x), i * spacing_m)])
        turn = np.column_stack([length_m + radius_m * np.cos(arc), radius_m * np.sin(arc)])
        turn[:, 1] += (i + 0.5) * spacing_m
        line = np.vstack([straight, turn]) if i < lines - 1 else straight
        pieces.append(line if i % 2 == 0 else line * [-1, 1] + [length_m, 0])
    xy = np.vstack(pieces)
    poses = np.zeros((len(xy), 6))
    poses[:, :2], poses[:, 2] = xy, -10
    poses[:, 5] = np.arctan2(*np.gradient(xy, axis=0).T[::-1])
    return poses


def place(poses, offsets_m, z):
    """Beams [P·K, 3]: across-track offsets [K] turned and moved by the poses [P, 6]."""
    yaw = poses[:, 5:]
    x = poses[:, :1] - np.sin(yaw) * offsets_m
    y = poses[:, 1:2] + np.cos(yaw) * offsets_m
    return np.column_stack([x.ravel(), y.ravel(), z])


def predict_seabed(xy):
    return seabed(xy) + 0.05 * np.sin(xy[:, 0]), np.full(len(xy), 0.05**2)


def make_map():
    x, y = np.arange(-12, 113, 1.0), np.arange(-14, 65, 1.0)
    points = np.stack(np.meshgrid(x, y, indexing="ij"), -1).reshape(-1, 2)
    mean, variance = (values.reshape(len(x), len(y)) for values in predict_seabed(points))
    outside = (x < -8)[:, None] | (y > 60)
    edge = np.clip(np.abs(points[:, 1] - 25) - 32, 0, None).reshape(len(x), len(y))
    mean, variance = np.where(outside, np.nan, mean), np.where(outside, np.nan, variance)
    return GridMap(x, y, mean, variance + 0.02 * edge)


def make_terrain():
    x, y = np.arange(-30, 130, 0.5), np.arange(-30, 80, 0.5)
    points = np.stack(np.meshgrid(x, y, indexing="ij"), -1).reshape(-1, 2)
    return GridMap(x, y, seabed(points).reshape(len(x), len(y)))


def make_history(t_s, duration_s):
    phase = (t_s - t_s[0]) / duration_s
    return {
        "t_s": t_s,
        "n_eff": 100 * (1 - (phase * 5) % 1 * 0.55),
        "loop_closure_prompts": np.floor(phase * 60),
        "resamplings": np.floor(phase * 5),
        "iterations_total": 90_000 * phase,
        "elbo": -3 + 2.5 * (1 - np.exp(-phase * 6)),
    }


def make_run(seed=0):
    """A survey of six lines whose DR drifts by up to 6 m, and whose estimate errs by 0.5 m."""
    rng = np.random.default_rng(seed)
    truth = lawn_mower()
    phase = np.linspace(0, 1, len(truth))[:, None]
    drift, wander = np.zeros_like(truth), np.zeros_like(truth)
    drift[:, :2] = phase**1.5 * [4.5, -4.0]
    wander[:, :2] = 0.5 * np.sin(phase * [[9.0, 14.0]])
    offsets_m = np.linspace(-12, 12, 40)
    footprints = place(truth, offsets_m, np.zeros(len(truth) * len(offsets_m)))
    z = seabed(footprints[:, :2]) + NOISE_M * rng.standard_normal(len(footprints))
    stamp_s = 1.6e9 + 0.5 * np.arange(len(truth))
    x, y = np.meshgrid(np.arange(-10, 110, 10.0), np.arange(-12, 62, 10.0))
    duration_s = float(stamp_s[-1] - stamp_s[0])
    statistics = dict(
        particles=100, nodes=2, seed=seed, pings=len(truth), pings_dropped=0, wall_s=150.0
    )
    statistics.update(beams=len(z), duration_s=duration_s, iterations_total=90_000)
    statistics.update(loop_closure_prompts=60, resamplings=5)
    statistics["peak_rss_mb"] = {"rbpf_core": 210.4, "svgp_node_0": np.float32(812.5)}
    return SurveyRun(
        stamp_s=stamp_s,
        estimate=truth + wander,
        estimate_std_m=0.05 + np.abs(wander[:, :2]) * 0.5 + 0.2 * phase,
        dead_reckoning=truth + drift,
        ground_truth=truth,
        levelled=np.column_stack([np.zeros(len(z)), np.tile(offsets_m, len(truth)), z]),
        ping_of_beam=np.repeat(np.arange(len(truth)), len(offsets_m)),
        held_out=np.arange(len(truth)) % 10 == 5,
        map=make_map(),
        predict=predict_seabed,
        noise_variance_m2=NOISE_M**2,
        support_points=np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]),
        support_label="inducing points",
        statistics=statistics,
        status_history=make_history(stamp_s[::10], duration_s),
        terrain=make_terrain(),
        config={"particles": 100, "svgp": {"inducing_points": 96, "kernel": "matern12"}},
    )


@pytest.fixture(scope="module")
def run():
    return make_run()


@pytest.fixture(scope="module")
def folder(run, tmp_path_factory):
    out_dir = tmp_path_factory.mktemp("survey") / "run"
    return out_dir, write_run(run, out_dir)


# Trajectories


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


def random_tracks(rng, pings=60):
    """Poses and truth [P, 6] at any attitude; truth is unknown at a gap and at the end."""
    poses, truth = rng.normal(0, 1, (2, pings, 6)) * [20, 20, 5, 0.5, 0.5, 2]
    truth[10:14] = np.nan
    truth[-1] = np.nan
    return poses, truth


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


def test_interpolation_is_linear_and_takes_yaw_the_short_way_round():
    poses = np.array([[0, 0, -5, 0, 0, np.pi - 0.1], [2, 4, -7, 0, 0, -np.pi + 0.3]])
    result = interpolate_poses([10.0, 12.0], poses, [9.99, 10.0, 11.0, 12.0, 12.01])
    assert np.isnan(result[[0, 4]]).all()
    np.testing.assert_allclose(result[2, :3], [1, 2, -6])
    np.testing.assert_allclose(result[1:4, 5], [np.pi - 0.1, -np.pi + 0.1, -np.pi + 0.3])


def test_interpolation_sorts_messages_and_respects_gaps():
    poses = np.zeros((4, 6))
    poses[:, 0] = [5.0, 0.0, 1.0, 9.0]
    stamp_s = [5.0, 0.0, 1.0, 1.0]
    x = interpolate_poses(stamp_s, poses, [0.5, 1.0, 3.0, 5.0], max_gap_s=2.0)[:, 0]
    np.testing.assert_allclose(x, [0.5, 1.0, np.nan, 5.0])
    assert np.isnan(interpolate_poses([1.0], poses[:1], [1.0])).all()
    with pytest.raises(ValueError, match="finite"):
        interpolate_poses([0.0, 1.0], np.full((2, 6), np.nan), [0.5])


@settings(max_examples=30, deadline=None)
@given(
    angles=st.tuples(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1)),
    position=st.tuples(*[st.floats(-1e4, 1e4)] * 3),
)
def test_tum_round_trip(tmp_path_factory, angles, position):
    path = tmp_path_factory.mktemp("tum") / "track.tum"
    poses = np.array([[*position, *angles], np.full(6, np.nan)])
    write_tum(path, np.array([1.6e9 + 0.25, 1.6e9 + 1]), poses)
    stamp_s, read = read_tum(path)
    assert stamp_s == [1.6e9 + 0.25]
    # Nine decimals of metres; a quaternion's nine decimals near pitch = ±1.5 rad, where roll and
    # yaw are cos(1.5) = 0.07 apart from degenerate.
    np.testing.assert_allclose(read[0, :3], position, atol=1e-9, rtol=0)
    np.testing.assert_allclose(read[0, 3:], angles, atol=1e-7, rtol=0)


def test_tum_without_poses_is_empty(tmp_path):
    write_tum(tmp_path / "empty.tum", np.empty(0), np.empty((0, 6)))
    stamp_s, poses = read_tum(tmp_path / "empty.tum")
    assert stamp_s.shape == (0,) and poses.shape == (0, 6)


@pytest.mark.parametrize(
    "line, message",
    [
        ("1 2 3", "expected 8 numbers .*, got 3"),
        ("2 0 0 0 0 0 0 one", "expected 8 numbers, got"),
        ("2 nan 0 0 0 0 0 1", "expected finite numbers"),
        ("2 0 0 0 0 0 0 2", "expected a unit quaternion, got one of norm 2"),
        ("0.5 0 0 0 0 0 0 1", "expected increasing stamps, got 0.5"),
    ],
)
def test_malformed_tum_line_is_named(tmp_path, line, message):
    path = tmp_path / "bad.tum"
    path.write_text(f"# a comment\n1 0 0 0 0 0 0 1\n\n{line}\n")
    with pytest.raises(ValueError, match=f"bad.tum:4: {message}"):
        read_tum(path)


# Maps


def test_msll_of_the_trivial_predictor_is_zero():
    z = np.random.default_rng(1).normal(-20, 2, 500)
    trivial = np.full(500, z.mean()), np.full(500, z.var())
    assert map_metrics.msll(z, *trivial, z.mean(), z.var()) == pytest.approx(0, abs=1e-12)


def test_msll_of_the_exact_predictor_is_the_log_ratio_of_the_spreads():
    # E[msll] = log(σ/s) for z ~ N(0, s²): with 200,000 draws the two quadratic terms, each of
    # mean 1/2 and std 1/√2, leave a standard error below 0.003; five of them are allowed.
    rng = np.random.default_rng(2)
    mean = rng.normal(0, 3, 200_000)
    z = mean + rng.normal(0, 0.3, mean.size)
    score = map_metrics.msll(z, mean, np.full(mean.size, 0.09), 0.0, 9.09)
    assert score == pytest.approx(np.log(0.3 / np.sqrt(9.09)), abs=0.015)


def test_grid_takes_the_nearest_filled_cell_within_the_neighbourhood():
    training = np.array([[0.2, 0.5, -1.0], [0.8, 0.5, -3.0], [5.5, 0.5, -7.0]])
    xy = np.array([[0.9, 0.9], [1.2, 1.9], [3.5, 0.5], [4.1, -0.3], [-0.5, 0.5]])
    z = map_metrics.grid_prediction(training, xy)
    np.testing.assert_allclose(z, [-2.0, -2.0, np.nan, -7.0, -2.0])
    assert np.isnan(map_metrics.grid_prediction(np.empty((0, 3)), xy)).all()


@given(st.tuples(*[st.floats(-1e6, 1e6)] * 2), st.sampled_from([0.5, 1.0, 2.0]))
def test_cell_keys_name_the_cell_that_holds_the_point(xy, resolution_m):
    key = cells.cell_keys(np.array([xy]), resolution_m)
    centre = cells.cell_centres(key, resolution_m)[0]
    np.testing.assert_array_equal(
        np.floor(centre / resolution_m), np.floor(np.array(xy) / resolution_m)
    )
    around = cells.cell_centres(cells.neighbour_keys(key)[0], resolution_m)
    steps = {tuple(step) for step in np.round((around - centre) / resolution_m).astype(int)}
    assert steps == set(itertools.product((-1, 0, 1), repeat=2))


def test_grid_on_a_map_leaves_out_what_lies_beyond_it():
    grid = GridMap(np.arange(3.0), np.arange(2.0), np.zeros((3, 2)))
    points = np.array([[0.4, 0.4, 1.0], [-0.4, -0.4, 3.0], [2.4, 1.4, 5.0], [2.6, 0.0, 9.0]])
    expected = [[2.0, np.nan], [np.nan, np.nan], [np.nan, 5.0]]
    np.testing.assert_array_equal(map_metrics.grid_on(grid, points), expected)


# Consistency


def two_planes(dz_m):
    x, y = np.meshgrid(np.arange(0.25, 20, 0.5), np.arange(0.25, 10, 0.5))
    plane = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, -30.0)])
    passes = np.repeat([0, 1], len(plane))
    return np.vstack([plane, plane + [0, 0, dz_m]]), passes


@pytest.mark.parametrize("dz_m", [0.4, -2.5])
def test_consistency_of_two_planes_is_their_distance(dz_m):
    points, passes = two_planes(dz_m)
    result = consistency(points, passes, ConsistencySettings(), np.random.default_rng(0))
    assert result.rms_m == pytest.approx(abs(dz_m), abs=ROUNDING_M)
    assert len(result.error_m) == 200
    assert result.points_per_cell_and_pass == 4


def test_consistency_ignores_cells_above_which_nothing_disagrees():
    points, passes = two_planes(0.0)
    result = consistency(points, passes, ConsistencySettings(), np.random.default_rng(0))
    assert result.rms_m is None and len(result.error_m) == 0


def brute_force(points, passes, resolution_m):
    """Per cell, per pass: the farthest-pass distances [2] of its points, by the definition."""
    cell_of = [tuple(np.floor(point[:2] / resolution_m).astype(int)) for point in points]
    result = {}
    for point, own, (i, j) in zip(points, passes, cell_of):
        nearest, in_cell = {}, {other for other, c in zip(passes, cell_of) if c == (i, j)}
        for other_point, other, (k, m) in zip(points, passes, cell_of):
            if other != own and abs(i - k) <= 1 and abs(j - m) <= 1:
                distance = np.linalg.norm(point - other_point)
                nearest[other] = min(distance, nearest.get(other, np.inf))
        group = result.setdefault((i, j), {}).setdefault(own, [])
        overlap = (nearest[other] for other in nearest if other in in_cell)
        group.append([max(nearest.values(), default=0.0), max(overlap, default=0.0)])
    return result


def scattered(rng, n=250):
    """Points of four passes, steep enough that nearest points lie beyond the 3 × 3 cells."""
    points = rng.uniform([-5, -4, -3], [5, 4, 3], (n, 3))
    return points, rng.integers(0, 4, n)


def test_farthest_pass_distance_equals_brute_force():
    points, passes = scattered(np.random.default_rng(3))
    keys = cells.cell_keys(points[:, :2], 1.0)
    order = np.argsort(keys, kind="stable")
    points, passes, keys = points[order], passes[order], keys[order]
    cell_key, cell = np.unique(keys, return_inverse=True)
    ours = farthest_pass_distance(points, passes, cell_key, cell)
    expected = brute_force(points, passes, 1.0)
    for centre, c in zip(cells.cell_centres(cell_key, 1.0), range(len(cell_key))):
        for number, distances in expected[tuple(np.floor(centre).astype(int))].items():
            mine = ours[(cell == c) & (passes == number)]
            np.testing.assert_allclose(mine, distances, atol=ROUNDING_M)


def test_consistency_draws_have_the_mean_of_brute_force():
    points, passes = scattered(np.random.default_rng(4), n=120)
    drawn = ConsistencySettings(draws=4000)
    result = consistency(points, passes, drawn, np.random.default_rng(0))
    ours = {tuple(np.floor(c).astype(int)): e for c, e in zip(result.centre_m, result.error_m)}
    expected = []
    for cell, groups in brute_force(points, passes, 1.0).items():
        largest = np.max(list(itertools.product(*groups.values())), axis=1)
        expected.append(largest.mean(axis=0))
        # Five standard errors of the mean of 4000 draws: one failure in a million cells.
        tolerance = 5 * largest[:, 1].std() / np.sqrt(drawn.draws) + ROUNDING_M
        assert ours.get(cell, 0.0) == pytest.approx(expected[-1][1], abs=tolerance)
    expected = np.ma.masked_equal(expected, 0.0)
    rms = np.sqrt((expected**2).mean(axis=0))
    # The RMS averages about 80 cells, each off by at most 5·0.5 m/√4000 = 0.04 m as above.
    np.testing.assert_allclose([result.rms_m, result.overlap_rms_m], rms, atol=0.01)


def test_consistency_is_thinned_as_the_settings_say():
    points, passes = two_planes(1.0)
    few = ConsistencySettings(max_points_per_cell=2)
    result = consistency(points, passes, few, np.random.default_rng(0))
    assert result.points_per_cell_and_pass == 2
    # The nearest of the other plane is at least dz away, and at most two diagonals of the cell.
    assert 1.0 <= result.rms_m <= 3.0
    fewer = ConsistencySettings(max_beams=100)
    result = consistency(points, passes, fewer, np.random.default_rng(0))
    assert result.points_per_cell_and_pass < 2


@pytest.mark.parametrize("error_m", [0.0, 0.2])
def test_consistency_of_map_and_beams_is_the_maps_error(run, error_m):
    # One beam a square metre at most has no neighbour that could be nearer than the map below it.
    z = seabed(run.beams[:, :2])
    few = np.random.default_rng(0).permutation(len(z))[:500]
    sparse = without(
        run,
        levelled=np.column_stack([run.levelled[few, :2], z[few]]),
        ping_of_beam=run.ping_of_beam[few],
        predict=lambda xy: (seabed(xy) + error_m, np.full(len(xy), 0.01)),
    )
    found = evaluate(sparse).report["map_consistency_rmse_m"]
    if error_m == 0.0:
        # Cells without error do not count, and roundings are no more than that.
        assert found is None or found < ROUNDING_M
    else:
        assert found == pytest.approx(error_m, rel=0.05)


def test_passes_are_the_lines_of_a_lawn_mower_with_their_turns():
    poses = lawn_mower(lines=6)
    wobble = np.deg2rad(10) * np.sin(np.arange(len(poses)))
    passes = split_passes(poses[:, 5] + wobble)
    assert passes.max() == 5
    # In the middle of every line, away from the turns, the pass is the line.
    on_line = (poses[:, 0] > 5) & (poses[:, 0] < 95)
    np.testing.assert_array_equal(passes[on_line], np.round(poses[on_line, 1] / 10))


def test_a_survey_without_turns_is_cut_into_chunks():
    np.testing.assert_array_equal(split_passes(np.zeros(20)), np.repeat(np.arange(10), 2))
    assert split_passes(np.empty(0)).shape == (0,)


# Reports


def test_report_json_holds_the_contract_and_no_nan(folder):
    out_dir, report = folder

    def refuse(word):
        raise AssertionError(f"{word} in report.json")

    read = json.loads((out_dir / "report.json").read_text(), parse_constant=refuse)
    assert read == report
    assert [name for name in CONTRACT if report.get(name) is None] == []
    assert report["notes"] == []


def test_report_recovers_the_known_errors(run, folder):
    report = folder[1]
    truth, drift = run.ground_truth, run.dead_reckoning - run.ground_truth
    assert report["dr_ate_rmse_m"] == pytest.approx(np.sqrt(np.mean((drift**2).sum(axis=1))))
    assert report["final_error_m"] == pytest.approx(
        np.linalg.norm(run.estimate[-1, :3] - truth[-1, :3])
    )
    assert report["real_time_factor"] == pytest.approx(report["duration_s"] / 150)
    assert report["iterations_per_particle"] == 900
    for name in ("consistency_rmse_m", "overlap_consistency_rmse_m"):
        assert report[f"ground_truth_{name}"] < report[name] < report[f"dr_{name}"]
    # The map errs by 0.05·sin(x), RMS 0.0354 m, the beams by 0.1 m: 0.1061 m together. With 3,200
    # held-out beams its standard error is 0.1061/√6400 = 0.0013 m; four are allowed.
    assert report["map_rmse_at_ground_truth_m"] == pytest.approx(0.1061, abs=0.0053)
    # The mean of sin² over whole metres, not over x, is within 0.05 of a half.
    assert report["terrain_rmse_m"] == pytest.approx(0.05 / np.sqrt(2), rel=0.05)
    assert report["map_msll"] < -0.5


def test_run_folder_is_complete(run, folder):
    out_dir, _ = folder
    names = {path.name for path in out_dir.iterdir()}
    tracks = {"trajectory.tum", "dead_reckoning.tum", "ground_truth.tum"}
    data = {"map.npz", "survey.npz", "history.npz", "parameters.yaml"}
    assert names == tracks | data | {"report.json", "report.html"}
    with np.load(out_dir / "map.npz") as saved:
        for name in ("x", "y", "mean", "variance"):
            np.testing.assert_array_equal(saved[name], getattr(run.map, name))
    stamp_s, poses = read_tum(out_dir / "trajectory.tum")
    np.testing.assert_allclose(stamp_s, run.stamp_s)
    # Nine decimals of metres and of a unit quaternion.
    np.testing.assert_allclose(poses[:, :5], run.estimate[:, :5], atol=1e-8)


def test_html_holds_every_figure_and_parameter_and_needs_no_network(folder):
    text = (folder[0] / "report.html").read_text()
    figures = re.findall(r'<figure id="(\w+)">\s*<img [^>]*src="data:image/png;base64,iVBOR', text)
    assert figures == [
        "trajectories",
        "position_errors",
        "raw_bathymetry",
        "posterior",
        "seabed_maps",
        "consistency_maps",
        "held_out_residuals",
        "elbo",
        "filter_history",
    ]
    assert "svgp/kernel" in text and "matern12" in text
    # No address: base64 has no colon.
    assert "://" not in text and "<script" not in text and "url(" not in text


def without(run, **changes):
    return dataclasses.replace(run, **changes)


def test_without_ground_truth_errors_are_null(run, folder, tmp_path):
    blind = without(run, ground_truth=None, terrain=None)
    (tmp_path / "ground_truth.tum").write_text("of an earlier run")
    report = write_run(blind, tmp_path)
    errors = "ate_rmse_m final_error_m rpe_rmse_m".split()
    for name in [*errors, *(f"dr_{name}" for name in errors)]:
        assert report[name] is None
    assert report["map_rmse_m"] == folder[1]["map_rmse_m"]
    assert any("no ground truth" in note for note in report["notes"])
    assert not (tmp_path / "ground_truth.tum").exists()
    assert (tmp_path / "report.html").read_text().count("<figure id=") == 9


def test_without_held_out_pings_map_errors_are_null(run):
    report = evaluate(without(run, held_out=np.zeros(len(run.stamp_s), dtype=bool))).report
    assert report["map_rmse_m"] is None and report["grid_rmse_m"] is None
    assert any("no held-out beams" in note for note in report["notes"])


def test_beams_that_the_map_does_not_predict_are_left_out(run):
    def predict_half(xy):
        mean, variance = predict_seabed(xy)
        return np.where(xy[:, 0] < 50, mean, np.nan), variance

    report = evaluate(without(run, predict=predict_half)).report
    # Half of the survey, to within the turns at its ends.
    assert report["map_coverage"] == pytest.approx(0.5, abs=0.1)
    assert report["map_rmse_m"] == pytest.approx(0.12, abs=0.03)
    nowhere = evaluate(without(run, predict=lambda xy: np.full((2, len(xy)), np.nan))).report
    assert nowhere["map_rmse_m"] is None
    assert any("predicts no held-out beam" in note for note in nowhere["notes"])


def test_with_all_pings_held_out_the_grid_says_nothing(run):
    report = evaluate(without(run, held_out=np.ones(len(run.stamp_s), dtype=bool))).report
    assert report["map_rmse_m"] is not None
    assert report["grid_rmse_m"] is None and report["map_msll"] is None
    assert report["grid_coverage"] == 0


@pytest.mark.parametrize("pings", [0, 1])
def test_a_survey_without_beams_is_reported(run, tmp_path, pings):
    none = np.empty((0, 3), dtype=np.float32)
    few = {
        name: getattr(run, name)[:pings]
        for name in "stamp_s estimate estimate_std_m dead_reckoning ground_truth held_out".split()
    }
    empty = without(
        run,
        **few,
        levelled=none,
        ping_of_beam=np.empty(0, dtype=int),
        statistics={},
        status_history={},
        config={},
    )
    report = write_run(empty, tmp_path)
    assert report["beams"] == 0 and report["map_rmse_m"] is None
    assert report["consistency_rmse_m"] is None and report["particles"] is None
    assert any("not recorded" in note for note in report["notes"])


def test_beams_that_are_not_finite_are_left_out_and_counted(run):
    levelled = run.levelled.copy()
    levelled[:7] = np.nan
    report = evaluate(without(run, levelled=levelled)).report
    assert any(note.startswith("7 beams are not finite") for note in report["notes"])
    assert report["map_rmse_m"] is not None


def test_wrong_shapes_are_named(run):
    with pytest.raises(ValueError, match=r"held_out: expected shape \(\d+,\), got \(2,\)"):
        without(run, held_out=np.zeros(2, dtype=bool))
    with pytest.raises(ValueError, match="ping_of_beam: expected indices"):
        without(run, ping_of_beam=run.ping_of_beam + 10_000)


def test_json_has_plain_numbers_only():
    value = {"a": np.float32(1.5), "b": np.array([1, np.inf]), "c": (np.int64(2), float("nan"))}
    assert json_ready(value) == {"a": 1.5, "b": [1.0, None], "c": [2, None]}
    assert json_ready(np.bool_(True)) is True
