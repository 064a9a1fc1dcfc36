"""The simulated vehicle, and dead reckoning from its twists against closed forms."""

import dataclasses
import math

import numpy as np
import pytest
from small_survey import EXACT

from rbpf_svgp_slam.bags.recorded_survey import Trajectory, rotation_from_rpy
from rbpf_svgp_slam.simulation.dead_reckoning import (
    DeadReckoningNoise,
    draw_biases,
    horizontal_errors,
    integrate_twist,
    simulate_dead_reckoning,
)
from rbpf_svgp_slam.simulation.vehicle import levelling_rotation


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


def test_a_current_carries_off_by_the_map_and_a_velocity_bias_by_the_body():
    truth = straight_track()
    turned = dataclasses.replace(
        truth, rpy_rad=truth.rpy_rad + [0, 0, 1.0], position_m=np.zeros_like(truth.position_m)
    )
    for field, turns_with_body in (("current_mps", False), ("velocity_bias_mps", True)):
        noise = dataclasses.replace(EXACT, **{field: 0.02})
        drifts_mps = []
        for track in (truth, turned):
            odometry = simulate_dead_reckoning(track, noise, np.random.default_rng(3))
            exact = simulate_dead_reckoning(track, EXACT, np.random.default_rng(3))
            off_m = (odometry.position_m - exact.position_m)[1:, :2]
            drift_mps = off_m / truth.time_s[1:, None]
            assert np.ptp(drift_mps, axis=0).max() < 1e-9 and 0 < np.abs(drift_mps).max() < 0.08
            drifts_mps.append(drift_mps[-1])
        c, s = np.cos(1.0), np.sin(1.0)
        expected = np.array([[c, -s], [s, c]]) @ drifts_mps[0] if turns_with_body else drifts_mps[0]
        np.testing.assert_allclose(drifts_mps[1], expected, atol=1e-9)


def test_noise_without_a_current_draws_what_it_has_always_drawn():
    rng, without = np.random.default_rng(7), np.random.default_rng(7)
    draw_biases(DeadReckoningNoise(), rng)
    without.standard_normal(2)
    assert rng.standard_normal() == without.standard_normal(), "seeds keep their surveys"


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
