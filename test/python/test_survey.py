"""The survey simulator against closed forms."""

import dataclasses
import math
import pathlib

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rbpf_svgp_slam.bags.recorded_survey import Trajectory, rotation_from_rpy
from rbpf_svgp_slam.simulation import SurveyError, sonar
from rbpf_svgp_slam.simulation.dead_reckoning import (
    DeadReckoningNoise,
    horizontal_errors,
    integrate_twist,
    simulate_dead_reckoning,
)
from rbpf_svgp_slam.simulation.mission import MISSIONS, get_mission, plan_waypoints
from rbpf_svgp_slam.simulation.simulation import make_terrain, simulate_survey
from rbpf_svgp_slam.simulation.terrain import Terrain, load_terrain, save_terrain
from rbpf_svgp_slam.simulation.vehicle import levelling_rotation, simulate_vehicle

REAL_SEABED = pathlib.Path(__file__).resolve().parents[3] / "shared/data/block_b_1m.npz"
QUIET = sonar.SonarNoise(range_fraction=0, angle_rad=0, outlier_share=0, nan_share=0)
EXACT = DeadReckoningNoise(0, 0, 0, 0, 0, 0, 0)
# The caster bisects to within 1 mm along the ray.
CAST_TOLERANCE_M = 1.1e-3


def plane(slope_x=0.0, slope_y=0.0, resolution_m=1.0):
    """z = -30 + slope_x x + slope_y y over x, y in -100 .. 100 m."""
    axis_m = np.arange(-100, 100 + resolution_m, resolution_m)
    z_m = -30 + slope_x * axis_m[:, None] + slope_y * axis_m[None, :]
    return Terrain(z_m.astype(np.float32), resolution_m, np.array([-100.0, -100.0]))


def generated(mission, seed=0):
    return make_terrain(mission, None, np.random.default_rng(seed))


@pytest.fixture(scope="module")
def demo_truth():
    """A quarter of the demo: lines in both directions and all turns, over generated terrain."""
    mission = get_mission("demo", 0.25)
    terrain = generated(mission)
    waypoints_m = plan_waypoints(mission)
    truth = simulate_vehicle(mission, waypoints_m, terrain, np.random.default_rng(1))
    return mission, terrain, waypoints_m, truth


# --- terrain ---


def test_bilinear_height_is_exact_on_a_plane_and_nan_off_the_grid():
    terrain = plane(0.1, -0.2, resolution_m=0.5)
    x_m, y_m = np.random.default_rng(0).uniform(-100, 100, (2, 1000))
    expected_m = -30 + 0.1 * x_m - 0.2 * y_m
    # float32 nodes of up to 60 m are rounded by 2e-6 m.
    np.testing.assert_allclose(terrain.height_m(x_m, y_m), expected_m, atol=1e-5)
    off = terrain.height_m(np.array([-100.01, 0.0, 100.01]), np.array([0.0, 100.01, 0.0]))
    assert np.isnan(off).all()


def test_generated_terrain_has_relief_and_depends_on_the_seed():
    mission = MISSIONS["demo"]
    one, same, other = generated(mission, 1), generated(mission, 1), generated(mission, 2)
    assert np.array_equal(one.z_m, same.z_m)
    assert not np.array_equal(one.z_m, other.z_m)
    assert 5 < np.ptp(one.z_m) < 20
    assert one.contains(*(-mission.margin_m * np.ones(2)))
    assert one.contains(*(np.array(mission.area_m) + mission.margin_m))


def test_terrain_file_round_trip_and_default_placement(tmp_path):
    terrain = plane(0.1)
    save_terrain(tmp_path / "t.npz", terrain)
    loaded = load_terrain(tmp_path / "t.npz", centre_m=(7.0, 7.0))
    assert np.array_equal(loaded.z_m, terrain.z_m)
    assert np.array_equal(loaded.origin_m, terrain.origin_m)
    np.savez(tmp_path / "unplaced.npz", z=terrain.z_m, resolution_m=1.0)
    unplaced = load_terrain(tmp_path / "unplaced.npz", centre_m=(7.0, 9.0))
    np.testing.assert_allclose(0.5 * (unplaced.origin_m + unplaced.upper_m), [7.0, 9.0])


@pytest.mark.parametrize(
    "arrays, message",
    [
        ({"resolution_m": 1.0}, "'z' is missing"),
        ({"z": np.zeros((9, 9))}, "'resolution_m' is missing"),
        ({"z": np.zeros(9), "resolution_m": 1.0}, r"\(9,\), expected"),
        ({"z": np.full((9, 9), np.nan), "resolution_m": 1.0}, "no finite value"),
        ({"z": np.zeros((9, 9)), "resolution_m": -1.0}, "resolution_m is -1.0, expected"),
        ({"z": np.zeros((9, 9)), "resolution_m": 1.0, "origin_m": [0.0]}, "origin_m is"),
    ],
)
def test_terrain_file_mistakes_are_named(tmp_path, arrays, message):
    np.savez(tmp_path / "t.npz", **arrays)
    with pytest.raises(SurveyError, match=message):
        load_terrain(tmp_path / "t.npz", (0, 0))


# --- ray casting ---


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


# --- missions ---


@pytest.mark.parametrize("name", MISSIONS)
@pytest.mark.parametrize("scale", [0.25, 1.0])
def test_lines_stay_in_the_area_cross_each_other_and_return(name, scale):
    mission = get_mission(name, scale)
    waypoints_m = plan_waypoints(mission)
    area_m = np.array(mission.area_m)
    assert (waypoints_m >= mission.inset_m - 1e-9).all()
    assert (waypoints_m <= area_m - mission.inset_m + 1e-9).all()
    assert np.array_equal(waypoints_m[0], waypoints_m[-1])
    legs_m = np.diff(waypoints_m, axis=0)
    for axis in (0, 1):
        full = np.isclose(np.abs(legs_m[:, axis]), area_m[axis] - 2 * mission.inset_m)
        assert full.sum() >= 2, "lines from end to end in both directions"


@pytest.mark.parametrize("name", MISSIONS)
def test_scale_shortens_in_proportion(name):
    def track_m(scale):
        waypoints_m = plan_waypoints(get_mission(name, scale))
        return np.linalg.norm(np.diff(waypoints_m, axis=0), axis=1).sum()

    # Whole numbers of lines, and at least three crossings, make it rough.
    assert 0.2 < track_m(0.25) / track_m(1.0) < 0.4


def test_full_size_missions_match_the_numbers_they_are_made_after():
    assert MISSIONS["lolo3"].area_m == (250.0, 150.0)
    for name, beams, duration_s in (
        ("hugin1", 8.08e6, 4.45 * 3600),
        ("lolo2", 12.4e6, 2.25 * 3600),
    ):
        mission = MISSIONS[name]
        legs_m = np.diff(plan_waypoints(mission), axis=0)
        nominal_s = np.linalg.norm(legs_m, axis=1).sum() / mission.speed_mps
        # Turns are cut, which saves up to a percent of the way.
        assert nominal_s == pytest.approx(duration_s, rel=0.015)
        assert mission.beams * mission.ping_rate_hz * nominal_s == pytest.approx(beams, rel=0.015)


@pytest.mark.parametrize("name, scale", [("lolo9", 1.0), ("demo", 0.0), ("demo", math.nan)])
def test_unknown_missions_and_scales_are_refused(name, scale):
    with pytest.raises(SurveyError, match=r"(mission|scale) is .*, expected"):
        get_mission(name, scale)
    with pytest.raises(SurveyError, match="at least two turn radii"):
        get_mission("demo", 0.001)


# --- vehicle ---


def test_vehicle_follows_the_lines_within_its_limits(demo_truth):
    mission, terrain, waypoints_m, truth = demo_truth
    xy_m = truth.position_m[:, :2]
    assert (xy_m > 0).all() and (xy_m < mission.area_m).all()
    nearest_m = [np.linalg.norm(xy_m - point, axis=1).min() for point in waypoints_m]
    assert max(nearest_m) < mission.turn_radius_m, "corners are cut, none is left out"
    level = levelling_rotation(truth.rpy_rad)
    yaw_rate_radps = np.gradient(truth.rpy_rad[:, 2], truth.time_s)
    assert np.abs(yaw_rate_radps).max() <= mission.max_yaw_rate_radps + 1e-9
    speed_mps = np.linalg.norm(level.apply(truth.linear_mps)[:, :2], axis=1)
    assert 0.85 * mission.speed_mps < speed_mps.min() and speed_mps.max() < 2.1
    altitude_m = truth.position_m[:, 2] - terrain.height_m(*xy_m.T)
    assert altitude_m.mean() == pytest.approx(mission.altitude_m, abs=0.5)
    assert altitude_m.min() > 0.6 * mission.altitude_m
    assert (
        np.ptp(truth.rpy_rad[:, 0]) > math.radians(5) and np.abs(truth.rpy_rad[:, :2]).max() < 0.2
    )


def test_exact_twists_integrate_to_the_true_pose(demo_truth):
    truth = demo_truth[-1]
    odometry = simulate_dead_reckoning(truth, EXACT, np.random.default_rng(0))
    np.testing.assert_allclose(odometry.position_m, truth.position_m, atol=1e-6)
    np.testing.assert_allclose(odometry.rpy_rad, truth.rpy_rad, atol=1e-9)
    vertical_mps = rotation_from_rpy(truth.rpy_rad).apply(truth.linear_mps)[:, 2]
    climbed_m = np.cumsum(vertical_mps) / demo_truth[0].odometry_rate_hz
    np.testing.assert_allclose(
        climbed_m, truth.position_m[:, 2] - truth.position_m[0, 2], atol=0.05
    )


def test_plain_euler_steps_agree_with_the_dead_reckoned_pose(demo_truth):
    """A filter that applies each message's twist from its stamp on stays within centimetres."""
    truth = demo_truth[-1]
    odometry = simulate_dead_reckoning(truth, DeadReckoningNoise(), np.random.default_rng(0))
    level_mps = levelling_rotation(odometry.rpy_rad).apply(odometry.linear_mps)[:, :2]
    roll_rad, pitch_rad, yaw_rad = odometry.rpy_rad.T
    q, r = odometry.angular_radps[:, 1:].T
    yaw_rate_radps = (q * np.sin(roll_rad) + r * np.cos(roll_rad)) / np.cos(pitch_rad)
    period_s = truth.time_s[1]
    euler_yaw_rad = yaw_rad[0] + np.concatenate([[0], np.cumsum(yaw_rate_radps)[:-1]]) * period_s
    heading = np.exp(1j * euler_yaw_rad[:-1])
    steps_m = heading * (level_mps[:-1, 0] + 1j * level_mps[:-1, 1]) * period_s
    end_m = truth.position_m[0, 0] + 1j * truth.position_m[0, 1] + steps_m.sum()
    # Half a period's lag: 0.2 m/sqrt(s) over 0.05 s is 0.045 m of noise, and the turns' share.
    assert abs(end_m - complex(*odometry.position_m[-1, :2])) < 0.2


# --- dead reckoning ---


def straight_track(duration_s=40.0, speed_mps=2.0, period_s=0.05):
    time_s = np.arange(0, duration_s + period_s / 2, period_s)
    zeros = np.zeros((len(time_s), 3))
    along = np.outer(time_s, [speed_mps, 0, 0])
    return Trajectory(time_s, along, zeros.copy(), zeros + [speed_mps, 0, 0], zeros.copy())


def test_white_noise_grows_with_the_square_root_of_time():
    truth, surveys = straight_track(), 400
    noise = DeadReckoningNoise(0.2, 0.1, 0.001, surge_scale=0, gyro_bias_radps=0)
    rng = np.random.default_rng(0)
    runs = [simulate_dead_reckoning(truth, noise, rng) for _ in range(surveys)]
    half, end = len(truth.time_s) // 2, len(truth.time_s) - 1
    for k in (half, end):
        t_s = truth.time_s[k]
        x_m = np.array([run.position_m[k, 0] for run in runs]) - truth.position_m[k, 0]
        y_m = np.array([run.position_m[k, 1] for run in runs])
        yaw_rad = np.array([run.rpy_rad[k, 2] for run in runs])
        # Heading errors add v^2 sigma_yaw^2 t^3 / 3 across the track.
        across_m2 = 0.1**2 * t_s + (2.0 * 0.001) ** 2 * t_s**3 / 3
        for values, variance in (
            (x_m, 0.2**2 * t_s),
            (y_m, across_m2),
            (yaw_rad, 0.001**2 * t_s),
        ):
            # Four standard errors: of a variance sqrt(2 / n) = 7 %, of a mean sigma / sqrt(n).
            assert values.var() == pytest.approx(variance, rel=4 * math.sqrt(2 / surveys))
            assert abs(values.mean()) < 4 * math.sqrt(variance / surveys)


def test_biases_are_constant_through_a_survey():
    truth = straight_track()
    scaled = simulate_dead_reckoning(
        truth, dataclasses.replace(EXACT, surge_scale=0.01), np.random.default_rng(3)
    )
    ratio = scaled.position_m[1:, 0] / truth.position_m[1:, 0]
    assert np.ptp(ratio) < 1e-9 and 0 < abs(ratio[0] - 1) < 0.04
    turning = simulate_dead_reckoning(
        truth, dataclasses.replace(EXACT, gyro_bias_radps=1e-4), np.random.default_rng(3)
    )
    rate_radps = turning.rpy_rad[1:, 2] / truth.time_s[1:]
    assert np.ptp(rate_radps) < 1e-12 and 0 < abs(rate_radps[0]) < 4e-4


def test_dead_reckoned_pose_is_the_integral_of_its_own_twists(demo_truth):
    truth = demo_truth[-1]
    odometry = simulate_dead_reckoning(truth, DeadReckoningNoise(), np.random.default_rng(5))
    start = (*truth.position_m[0, :2], truth.rpy_rad[0, 2])
    planar = integrate_twist(
        odometry.linear_mps, odometry.angular_radps, odometry.rpy_rad, start, truth.time_s[1]
    )
    np.testing.assert_allclose(planar[:, :2], odometry.position_m[:, :2], atol=1e-9)
    final_m, rmse_m = horizontal_errors(truth, odometry)
    assert 0.5 < rmse_m and 0.5 < final_m, "it drifts"


# --- sonar on the vehicle ---


def beams_in_map(pings, truth):
    """All beams [N, 3], brought into the map frame with the true poses."""
    position_m, rpy_rad = truth.poses_at(pings.time_s)
    mount = Rotation.from_euler("xyz", sonar.MOUNT_RPY_RAD)
    points_m = []
    for ping_m, translation_m, rotation in zip(
        pings.points_m, position_m, rotation_from_rpy(rpy_rad)
    ):
        body_m = mount.apply(ping_m) + sonar.MOUNT_TRANSLATION_M
        points_m.append(rotation.apply(body_m) + translation_m)
    return np.vstack(points_m)


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


def test_the_seed_decides_and_the_streams_are_separate():
    mission = get_mission("demo", 0.1)

    def run(seed, **options):
        return simulate_survey(mission, seed, max_duration_s=20, **options)

    one, same, other, quiet = run(1), run(1), run(2), run(1, noise=QUIET)
    pairs = zip(one.pings.points_m, same.pings.points_m)
    assert all(np.array_equal(a, b, equal_nan=True) for a, b in pairs)
    assert np.array_equal(one.odometry.linear_mps, same.odometry.linear_mps)
    assert not np.array_equal(one.odometry.linear_mps, other.odometry.linear_mps)
    assert not np.array_equal(one.terrain.z_m, other.terrain.z_m)
    assert np.array_equal(one.odometry.linear_mps, quiet.odometry.linear_mps)
    assert np.array_equal(one.terrain.z_m, quiet.terrain.z_m)


@pytest.mark.skipif(not REAL_SEABED.exists(), reason=f"no real seabed at {REAL_SEABED}")
def test_lolo3_over_a_real_seabed():
    mission = get_mission("lolo3")
    survey = simulate_survey(mission, 1, REAL_SEABED, QUIET, max_duration_s=200)
    x, y, z = beams_in_map(survey.pings, survey.truth).T
    np.testing.assert_allclose(z, survey.terrain.height_m(x, y), atol=2 * CAST_TOLERANCE_M)
    assert survey.terrain.contains(*survey.truth.position_m[:, :2].T).all()
