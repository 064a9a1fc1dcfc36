"""The simulated multibeam echosounder: rays against closed forms, and pings of a vehicle."""

import dataclasses
import math

import numpy as np
import pytest
from small_survey import CAST_TOLERANCE_M, QUIET, beams_in_map, generated, plane

from rbpf_svgp_slam.simulation import SurveyError, sonar
from rbpf_svgp_slam.simulation.mission import get_mission
from rbpf_svgp_slam.simulation.terrain import Terrain


def test_ranges_to_a_flat_seabed():
    angles_rad = sonar.beam_angles_rad(64, math.radians(120))
    origins_m = np.tile([0.0, 0.0, -10.0], (64, 1))
    ranges_m = sonar.cast_rays(plane(), origins_m, sonar.beam_directions(angles_rad), 100.0)
    np.testing.assert_allclose(ranges_m, 20 / np.cos(angles_rad), atol=CAST_TOLERANCE_M)


def test_ranges_to_a_sloping_seabed():
    rng = np.random.default_rng(0)
    origins_m = rng.uniform([-40, -40, -12], [40, 40, -8], (500, 3))
    directions = rng.normal(0, 0.5, (500, 3))
    directions[:, 2] = -1
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    # o_z + r d_z = a (o_x + r d_x) + b (o_y + r d_y) + c, solved for r
    slope = np.array([0.15, -0.1, -1.0])
    expected_m = -(origins_m @ slope - 30) / (directions @ slope)
    ranges_m = sonar.cast_rays(plane(0.15, -0.1), origins_m, directions, 200.0)
    ends_m = origins_m + expected_m[:, None] * directions
    on_grid = (np.abs(ends_m[:, :2]) < 100).all(axis=1)
    assert on_grid.sum() > 450
    np.testing.assert_allclose(ranges_m[on_grid], expected_m[on_grid], atol=CAST_TOLERANCE_M)


def test_hits_lie_on_rough_terrain_and_nothing_is_in_the_way():
    terrain = generated(get_mission("demo", 0.25))
    angles_rad = sonar.beam_angles_rad(300, math.radians(120))
    directions = sonar.beam_directions(angles_rad)
    origins_m = np.tile([60.0, 40.0, -23.0], (300, 1))
    ranges_m = sonar.cast_rays(terrain, origins_m, directions, 100.0)
    x, y, z = (origins_m + ranges_m[:, None] * directions).T
    np.testing.assert_allclose(z, terrain.height_m(x, y), atol=CAST_TOLERANCE_M)
    for share in np.linspace(0, 0.99, 100):
        x, y, z = (origins_m + share * ranges_m[:, None] * directions).T
        # A crest cut for less than a cell's width may be missed: at most a shallow cut.
        assert (z - terrain.height_m(x, y)).min() > -0.1


def test_rays_that_leave_the_grid_or_the_range_gate_are_misses():
    directions = sonar.beam_directions(np.radians([0.0, 60.0, 60.0]))
    origins_m = np.array([[0.0, 0.0, -10.0], [0.0, 0.0, -10.0], [0.0, 90.0, -10.0]])
    ranges_m = sonar.cast_rays(plane(), origins_m, directions, 30.0)
    assert list(np.isnan(ranges_m)) == [False, True, True]
    # z = 0 at the edge y = 100 m, where this ray comes in at z = -16 m, below the seabed.
    inwards = sonar.beam_directions(np.radians([-60.0]))
    buried = sonar.cast_rays(plane(0, 0.3), np.array([[0.0, 110.0, -10.0]]), inwards, 100.0)
    assert np.isnan(buried).all()


def test_a_hole_under_the_swath_is_refused_and_elsewhere_allowed():
    terrain = plane()
    terrain.z_m[100, 110] = np.nan  # x = 0 m, y = 10 m
    directions = sonar.beam_directions(np.radians([26.5, -26.5]))
    origins_m = np.tile([0.0, 0.0, -10.0], (2, 1))
    with pytest.raises(SurveyError, match="NaN under the swath at x = 0.0 m, y = 10.0 m"):
        sonar.cast_rays(terrain, origins_m[:1], directions[:1], 100.0)
    assert np.isfinite(sonar.cast_rays(terrain, origins_m[1:], directions[1:], 100.0)).all()


def test_levelled_pings_with_the_true_poses_fall_on_the_terrain(demo_truth):
    mission, terrain, _, truth = demo_truth
    rng = np.random.default_rng(0)
    pings = sonar.simulate_pings(terrain, truth, mission, QUIET, rng)
    x, y, z = beams_in_map(pings, truth).T
    np.testing.assert_allclose(z, terrain.height_m(x, y), atol=2 * CAST_TOLERANCE_M)
    np.testing.assert_allclose(pings.box_m, [[x.min(), y.min()], [x.max(), y.max()]], atol=0.01)
    assert np.diff(pings.time_s).min() > 0 and pings.time_s[-1] < truth.time_s[-1]
    off_stamp_s = np.abs(pings.time_s[:, None] - truth.time_s[None, :]).min(axis=1)
    assert np.median(off_stamp_s) > 0.005, "pings do not fall on odometry stamps"


def test_beam_noise_grows_with_the_angle_and_outliers_have_their_share(demo_truth):
    mission, _, _, truth = demo_truth
    mission = dataclasses.replace(mission, max_range_m=80.0)
    flat = Terrain(np.full((700, 700), -40, np.float32), 1.0, np.array([-300.0, -300.0]))
    noise = sonar.SonarNoise(outlier_share=0.02, nan_share=0.01)
    pings = sonar.simulate_pings(flat, truth, mission, noise, np.random.default_rng(0))
    points_m = np.array(pings.points_m)  # over flat ground no beam is missed
    missing = np.isnan(points_m[..., 2])
    beams = missing.size
    # Four standard errors of a share.
    assert missing.mean() == pytest.approx(0.01, abs=4 * math.sqrt(0.01 / beams))
    residual_m = beams_in_map(pings, truth)[:, 2].reshape(missing.shape) + 40
    residual_m[missing] = np.nan
    # Of the false ranges, uniform over 0.3 .. 1.3, some 4 % are within 0.7 m of 17 m or more.
    outliers = np.nanmean(np.abs(residual_m) > 0.7)
    assert outliers == pytest.approx(0.02, rel=0.15)
    spread_m = np.nanmedian(np.abs(residual_m), axis=0)
    middle = mission.beams // 2
    outer = 0.5 * (spread_m[:5].mean() + spread_m[-5:].mean())
    assert outer > 1.5 * spread_m[middle - 5 : middle + 5].mean()
