"""What makes beams of travel times and angles: rays, cones, the map frame, tracks, drift."""

import dataclasses

import numpy as np
import pytest
from sonar_files import ANGLES_RAD

from rbpf_svgp_slam.bags.recorded_survey import Trajectory
from rbpf_svgp_slam.importers.beam_geometry import in_map, in_sensor
from rbpf_svgp_slam.importers.degrade import degrade_odometry, scaled
from rbpf_svgp_slam.importers.ray_tracing import bent
from rbpf_svgp_slam.importers.sonar_file import ImportProblem
from rbpf_svgp_slam.importers.sonar_recording import (
    Attitudes,
    Installation,
    Placed,
    Positions,
    Recording,
    SoundSpeedProfile,
    Swath,
)
from rbpf_svgp_slam.importers.vehicle_track import make_tracks, moving
from rbpf_svgp_slam.simulation.dead_reckoning import DeadReckoningNoise

SPEED_MPS = 1500.0


# Rays


def test_in_water_of_one_speed_rays_are_straight():
    time_s = np.full(len(ANGLES_RAD), 0.02)
    profile = SoundSpeedProfile(np.array([0.0, 100.0]), np.full(2, SPEED_MPS))
    ends_m = bent(ANGLES_RAD, time_s, SPEED_MPS, 3.0, profile)
    range_m = SPEED_MPS * 0.02
    expected = range_m * np.column_stack([np.sin(ANGLES_RAD), np.cos(ANGLES_RAD)])
    np.testing.assert_allclose(ends_m, expected, atol=1e-9)


@pytest.mark.parametrize("gradient_per_s", [-1.0, 1.0])
def test_in_water_of_one_gradient_rays_are_circles(gradient_per_s):
    time_s = np.full(len(ANGLES_RAD), 0.05)
    depth_m = np.array([0.0, 200.0])
    profile = SoundSpeedProfile(depth_m, SPEED_MPS + gradient_per_s * depth_m)
    across_m, down_m = bent(ANGLES_RAD, time_s, SPEED_MPS, 0.0, profile).T
    # tan(angle / 2) grows by e^(gradient t), sin(angle) / speed is the ray's
    end_rad = 2 * np.arctan(np.tan(ANGLES_RAD / 2) * np.exp(gradient_per_s * time_s))
    parameter = np.sin(ANGLES_RAD) / SPEED_MPS
    with np.errstate(invalid="ignore"):
        expected_m = (np.cos(ANGLES_RAD) - np.cos(end_rad)) / (parameter * gradient_per_s)
    bent_rays = np.abs(ANGLES_RAD) > 1e-6
    # the layers' thickness
    np.testing.assert_allclose(across_m[bent_rays], expected_m[bent_rays], atol=2e-3)
    speed_at_end_mps = np.sin(end_rad[bent_rays]) / parameter[bent_rays]
    expected_m = (speed_at_end_mps - SPEED_MPS) / gradient_per_s
    np.testing.assert_allclose(down_m[bent_rays], expected_m, atol=2e-3)


def test_the_array_s_own_speed_bends_a_ray_by_snell():
    profile = SoundSpeedProfile(np.array([0.0, 100.0]), np.full(2, 1530.0))
    across_m, down_m = bent(np.array([0.5]), np.array([0.01]), 1500.0, 0.0, profile)[0]
    assert np.sin(np.arctan2(across_m, down_m)) == pytest.approx(np.sin(0.5) * 1530 / 1500)
    assert np.hypot(across_m, down_m) == pytest.approx(15.3)


def test_a_ray_that_turns_and_a_lost_beam_have_no_end():
    depth_m = np.array([0.0, 5.0, 100.0])
    profile = SoundSpeedProfile(depth_m, np.array([1500.0, 1600.0, 1600.0]))
    angles_rad, time_s = np.radians([0.0, 80.0, 0.0]), np.array([0.02, 0.02, np.nan])
    ends_m = bent(angles_rad, time_s, 1500.0, 0.0, profile)
    assert np.isfinite(ends_m[:, 0]).tolist() == [True, False, False]
    assert np.isnan(bent(angles_rad, np.full(3, np.nan), 1500.0, 0.0, profile)).all()


# Beams


def still(rpy_deg=(0.0, 0.0, 0.0), position_m=(0.0, 0.0, 0.0)):
    time_s = 0.1 * np.arange(11)
    rpy_rad = np.tile(np.radians(rpy_deg), (11, 1))
    return moving(time_s, np.tile(np.array(position_m, float), (11, 1)), rpy_rad)


def swath_to(points_m, transmitter_m, receiver_m, tilt_rad=0.0):
    """What arrays that lie level measure of points x forward, y left, z up."""
    there = np.linalg.norm(points_m - transmitter_m, axis=1)
    back = np.linalg.norm(points_m - receiver_m, axis=1)
    aside = -(points_m - receiver_m)[:, 1]
    travel_time_s = (there + back) / SPEED_MPS
    zeros = np.zeros(len(points_m))
    return Swath(0.2, zeros, travel_time_s, zeros + tilt_rad, np.arcsin(aside / back), SPEED_MPS)


def test_arrays_apart_find_the_seabed_between_both_ways():
    transmitter, receiver = Placed(1.0, -4.0, 7.0), Placed(-0.4, -4.9, 7.0)
    installation = Installation(transmitter, receiver)
    y = np.linspace(-15, 15, 41)
    points_m = np.column_stack([np.ones(41), y, np.full(41, -12.0)])
    swath = swath_to(points_m, np.array([1.0, 4.0, -7.0]), np.array([-0.4, 4.9, -7.0]))
    found_m = in_map(swath, still(), installation, None)
    # ten rounds of the search, in 5 m of water with arrays 1.7 m apart
    np.testing.assert_allclose(found_m, points_m, atol=2e-3)


S, C = np.sin(np.radians(10)), np.cos(np.radians(10))


@pytest.mark.parametrize(
    "rpy_deg, expected",
    [
        ((10.0, 0.0, 0.0), (0, S - C, -S - C)),  # starboard down: there, the beam ends deeper
        ((0.0, 10.0, 0.0), (-S, -1, -C)),  # bow down: it ends aft
        ((0.0, 0.0, 10.0), (S, -C, -1)),  # to port: starboard's beams go forward
    ],
)
def test_roll_pitch_and_yaw_turn_the_fan(rpy_deg, expected):
    swath = swath_to(np.array([[0.0, -1.0, -1.0]]) * 10, np.zeros(3), np.zeros(3))
    [found_m] = in_map(swath, still(rpy_deg), Installation(), None)
    np.testing.assert_allclose(found_m / 10, expected, atol=1e-9)


def test_points_go_into_the_sensor_s_frame_and_back():
    track = still((3.0, -2.0, 40.0), (5.0, 6.0, -1.0))
    sensor = Placed(1.0, 2.0, 0.5, *np.radians([4.0, -3.0, 2.0]))
    installation = Installation(sensor, sensor)
    swath = swath_to(np.array([[0.0, -5.0, -20.0], [0.0, 3.0, -20.0]]), np.zeros(3), np.zeros(3))
    map_m = in_map(swath, track, installation, None)
    sensor_m = in_sensor(map_m, 0.2, track, sensor)
    # as the arrays have measured it
    np.testing.assert_allclose(sensor_m, [[0, -5, -20], [0, 3, -20]], atol=1e-9)


def test_a_vehicle_that_moves_on_hears_the_echo_elsewhere():
    time_s = 0.1 * np.arange(101)
    position_m = np.column_stack([5.0 * time_s, 0 * time_s, 0 * time_s])
    track = moving(time_s, position_m, np.zeros((101, 3)))
    nadir = Swath(1.0, *np.zeros((1, 1)), np.array([2.0]), *np.zeros((2, 1)), SPEED_MPS)
    [point_m] = in_map(nadir, track, Installation(), None)
    # in the transmitter's plane when it was sent; the way back is 10 m oblique, 3 cm over 1500 m
    np.testing.assert_allclose(point_m, (5.0, 0.0, -1500.0), atol=0.05)


# The map frame


def test_the_map_frame_is_a_plane_that_touches_the_earth():
    pytest.importorskip("pyproj", reason="pyproj is not installed")
    from rbpf_svgp_slam.importers.local_frame import LocalFrame

    frame = LocalFrame(59.0, 18.0)
    np.testing.assert_allclose(frame.east_north(59.0, 18.0), 0.0, atol=1e-9)
    # a minute of latitude at 59°, and of longitude: WGS84's radii of curvature there
    radius_m, squared = 6378137.0, 6.69437999014e-3
    w = np.sqrt(1 - squared * np.sin(np.radians(59)) ** 2)
    minute_rad = np.radians(1 / 60)
    north_m = minute_rad * radius_m * (1 - squared) / w**3
    east_m = minute_rad * radius_m / w * np.cos(np.radians(59))
    places = frame.east_north(np.array([59 + 1 / 60, 59.0]), np.array([18.0, 18 + 1 / 60]))
    # the plane leaves the earth by the square of the distance: 0.3 m to the north at 1 km
    np.testing.assert_allclose(places, [[0, north_m], [east_m, 0]], atol=0.35)
    for latitude, longitude in ((91, 0), (0, 400), (np.nan, 0)):
        with pytest.raises(ImportProblem, match="expected a latitude within"):
            LocalFrame(latitude, longitude)


# Tracks


class Plane:
    """A map frame whose degrees are metres."""

    @staticmethod
    def east_north(latitude_deg, longitude_deg):
        return np.column_stack([longitude_deg, latitude_deg])


def recording(time_s, installation=Installation(), **attitudes):
    """To the east at 2 m/s."""
    zeros = np.zeros_like(time_s)
    columns = {"roll_rad": zeros, "pitch_rad": zeros, "heave_m": zeros}
    columns["heading_rad"] = zeros + np.pi / 2
    columns.update({name: zeros + value for name, value in attitudes.items()})
    return Recording(
        "file",
        "sonar",
        Positions(time_s, zeros, 2 * time_s),
        Attitudes(time_s=time_s, **columns),
        [],
        installation,
    )


def test_conventions_are_turned():
    time_s = np.arange(0, 5, 0.1)
    motion = {"roll_rad": 0.1, "pitch_rad": 0.2, "heave_m": 0.3}
    [track] = make_tracks(recording(time_s, **motion), Plane, 10.0)
    np.testing.assert_allclose(track.rpy_rad, np.tile([0.1, -0.2, 0.0], (len(track.time_s), 1)))
    np.testing.assert_allclose(track.position_m[:, 2], 0.3)
    np.testing.assert_allclose(track.position_m[:, 0], 2 * track.time_s, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(track.linear_mps, axis=1), 2.0)


def test_a_turned_and_displaced_motion_sensor():
    time_s = np.arange(0, 5, 0.1)
    motion = Placed(forward_m=10.0, roll_rad=0.1, pitch_rad=0.2)
    sensor = {"roll_rad": 0.1, "pitch_rad": 0.2}
    [level] = make_tracks(recording(time_s, Installation(motion=motion), **sensor), Plane, 10.0)
    np.testing.assert_allclose(level.rpy_rad, 0.0, atol=1e-9)
    forward = Placed(forward_m=10.0)
    bow_up = recording(time_s, Installation(motion=forward), pitch_rad=0.2, heave_m=0.0)
    [track] = make_tracks(bow_up, Plane, 10.0)
    # the sensor is lifted with the bow and has no heave: the reference point is down
    np.testing.assert_allclose(track.position_m[:, 2], -10 * np.sin(0.2))


def test_the_antenna_s_place_and_the_waterline():
    time_s = np.arange(0, 5, 0.1)
    installation = Installation(positioning=Placed(3.0, 1.0, -5.0), waterline_m=0.7)
    [track] = make_tracks(recording(time_s, installation), Plane, 10.0)
    # heading east: forward is x, starboard is -y
    offset_m = track.position_m - np.outer(track.time_s, [2, 0, 0])
    np.testing.assert_allclose(offset_m, np.tile([-3, 1, 0.7], (len(offset_m), 1)), atol=1e-9)


def test_gaps_divide_a_track():
    time_s = np.concatenate([np.arange(0, 5, 0.1), np.arange(20, 26, 0.1), [40.0, 40.1]])
    tracks = make_tracks(recording(time_s), Plane, 10.0)
    ends_s = [(track.time_s[0], track.time_s[-1]) for track in tracks]
    np.testing.assert_allclose(ends_s, [(0, 4.9), (20, 25.9)], atol=0.11)
    assert make_tracks(recording(np.array([0.0, 0.1])), Plane, 10.0) == []


# Drift


def long_track(begin_s, seconds=60.0):
    time_s = begin_s + 0.1 * np.arange(int(10 * seconds))
    yaw_rad = 0.01 * (time_s - begin_s)
    position_m = np.column_stack([100 * np.sin(yaw_rad), 100 * (1 - np.cos(yaw_rad)), 0 * time_s])
    zeros = np.zeros_like(time_s)
    return moving(time_s, position_m, np.column_stack([zeros, zeros, yaw_rad]))


def test_drift_grows_as_its_noise_says():
    noise = DeadReckoningNoise(yaw_rad_per_sqrt_s=0.0, surge_scale=0.0, gyro_bias_radps=0.0)
    truth = long_track(0.0)
    errors_m = [
        (degrade_odometry([truth], noise, seed)[0].position_m - truth.position_m)[-1, :2]
        for seed in range(40)
    ]
    expected_m = noise.surge_m_per_sqrt_s * np.sqrt(60)
    # 80 numbers: within 3 standard errors, 3 / sqrt(160), of their deviation
    assert np.sqrt(np.mean(np.square(errors_m))) == pytest.approx(expected_m, rel=0.24)
    assert dataclasses.astuple(scaled(noise, 0.0))[:5] == (0, 0, 0, 0, 0)


def test_over_a_gap_the_error_stays_as_it_is_in_the_body():
    tracks = [long_track(0.0), long_track(200.0)]
    one, two = degrade_odometry(tracks, DeadReckoningNoise(), 4)

    def step(before: Trajectory, after: Trajectory):
        """From the last pose before the gap to the first after it, in the body frame there."""
        delta = after.position_m[0, :2] - before.position_m[-1, :2]
        yaw = before.rpy_rad[-1, 2]
        c, s = np.cos(yaw), np.sin(yaw)
        turn_rad = after.rpy_rad[0, 2] - yaw
        return [c * delta[0] + s * delta[1], -s * delta[0] + c * delta[1], turn_rad]

    np.testing.assert_allclose(step(one, two), step(*tracks), atol=1e-9)
    assert np.abs(one.position_m - tracks[0].position_m).max() > 0.1
