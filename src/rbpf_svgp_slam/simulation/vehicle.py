"""The vehicle's true motion: line following with limited turn rate, roll, pitch and depth."""

import dataclasses
import math

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from rbpf_svgp_slam.bags.recorded_survey import Trajectory
from rbpf_svgp_slam.simulation import SurveyError


@dataclasses.dataclass(frozen=True)
class VehicleDynamics:
    """How the vehicle answers; frames as in REP 103 (x forward, y left, z up)."""

    yaw_rate_lag_s: float = 1.0
    heading_gain_per_s: float = 0.6
    lookahead_m: float = 8.0
    slowdown_in_turn: float = 0.1  # share of the speed lost at the largest turn rate
    sideslip_m: float = 0.5  # sway per yaw rate: the vehicle slides outwards
    bank_s: float = 0.25  # roll per yaw rate: the vehicle leans inwards
    roll_amplitude_rad: float = math.radians(1.2)
    pitch_amplitude_rad: float = math.radians(1.5)
    roll_period_s: float = 6.3
    pitch_period_s: float = 9.7
    pitch_trim_rad: float = math.radians(1.0)
    depth_smoothing_s: float = 30.0  # the seabed is followed no faster than this


def levelling_rotation(rpy_rad):
    """Rotations body -> levelled body: roll and pitch [N, 3] without the yaw."""
    return Rotation.from_euler("YX", rpy_rad[:, 1::-1])


def integrate_planar(level_mps, yaw_rate_radps, start, period_s):
    """Dead-reckon x, y, yaw [T, 3] from levelled velocities [T, 2] and yaw rates [T].

    Euler steps with the mean twist of an interval's two ends, at the interval's middle heading.
    """
    yaw_step_rad = 0.5 * period_s * (yaw_rate_radps[1:] + yaw_rate_radps[:-1])
    yaw_rad = start[2] + np.concatenate([[0.0], np.cumsum(yaw_step_rad)])
    middle_rad = yaw_rad[:-1] + 0.5 * yaw_step_rad
    forward_m, left_m = 0.5 * period_s * (level_mps[1:] + level_mps[:-1]).T
    cos, sin = np.cos(middle_rad), np.sin(middle_rad)
    steps_m = np.stack([cos * forward_m - sin * left_m, sin * forward_m + cos * left_m], axis=1)
    xy_m = np.asarray(start[:2]) + np.vstack([np.zeros(2), np.cumsum(steps_m, axis=0)])
    return np.column_stack([xy_m, yaw_rad])


def simulate_vehicle(mission, waypoints_m, terrain, rng, max_duration_s=math.inf):
    """Follow the waypoints [W, 2] over the terrain and return the true Trajectory."""
    dynamics = VehicleDynamics()
    period_s = 1.0 / mission.odometry_rate_hz
    level_mps, yaw_rate_radps = _follow(waypoints_m, mission, dynamics, period_s, max_duration_s)
    heading = waypoints_m[1] - waypoints_m[0]
    start = (*waypoints_m[0], math.atan2(heading[1], heading[0]))
    planar = integrate_planar(level_mps, yaw_rate_radps, start, period_s)
    time_s = period_s * np.arange(len(planar))
    z_m = _height_profile(planar[:, :2], terrain, mission, dynamics.depth_smoothing_s / period_s)
    climb_mps = np.gradient(z_m, period_s)
    roll_rad, pitch_rad = _attitude(time_s, level_mps, climb_mps, yaw_rate_radps, dynamics, rng)
    rpy_rad = np.column_stack([roll_rad, pitch_rad, planar[:, 2]])
    velocity_mps = np.column_stack([level_mps, climb_mps])
    return Trajectory(
        time_s=time_s,
        position_m=np.column_stack([planar[:, :2], z_m]),
        rpy_rad=rpy_rad,
        linear_mps=levelling_rotation(rpy_rad).inv().apply(velocity_mps),
        angular_radps=body_rates(rpy_rad, yaw_rate_radps, period_s),
    )


def body_rates(rpy_rad, yaw_rate_radps, period_s):
    """Body rates p, q, r [T, 3] of a vehicle with these attitudes [T, 3] and yaw rates [T]."""
    roll_rad, pitch_rad = rpy_rad[:, 0], rpy_rad[:, 1]
    roll_rate_radps = np.gradient(roll_rad, period_s)
    pitch_rate_radps = np.gradient(pitch_rad, period_s)
    level_yaw = yaw_rate_radps * np.cos(pitch_rad)
    # p = phi' - psi' sin(theta);  q = theta' cos(phi) + psi' cos(theta) sin(phi);
    # r = -theta' sin(phi) + psi' cos(theta) cos(phi)
    p = roll_rate_radps - yaw_rate_radps * np.sin(pitch_rad)
    q = pitch_rate_radps * np.cos(roll_rad) + level_yaw * np.sin(roll_rad)
    r = -pitch_rate_radps * np.sin(roll_rad) + level_yaw * np.cos(roll_rad)
    return np.column_stack([p, q, r])


def _follow(waypoints_m, mission, dynamics, period_s, max_duration_s):
    """Levelled velocities [T, 2] and yaw rates [T] of a vehicle that follows the waypoints.

    Plain floats in a loop: each step needs the one before.
    """
    (x, y), yaw = waypoints_m[0], None
    speed, sway, rate = mission.speed_mps, 0.0, 0.0
    states = [(speed, sway, rate)]
    most_states = max_duration_s / period_s
    switch_m = mission.turn_radius_m + speed * dynamics.yaw_rate_lag_s
    lines = list(zip(waypoints_m[:-1].tolist(), waypoints_m[1:].tolist()))
    for number, ((ax, ay), (bx, by)) in enumerate(lines, start=1):
        course = math.atan2(by - ay, bx - ax)
        cx, cy = math.cos(course), math.sin(course)
        yaw = course if yaw is None else yaw
        stop_m = 0.0 if number == len(lines) else switch_m
        while (bx - x) * cx + (by - y) * cy > stop_m and len(states) <= most_states:
            cross_m = (y - ay) * cx - (x - ax) * cy
            command = _steer(cross_m, course - yaw, mission.max_yaw_rate_radps, dynamics)
            last_speed, last_sway, last_rate = states[-1]
            rate += (command - rate) * period_s / dynamics.yaw_rate_lag_s
            turning = abs(rate) / mission.max_yaw_rate_radps
            speed = mission.speed_mps * (1 - dynamics.slowdown_in_turn * turning)
            sway = -dynamics.sideslip_m * rate
            states.append((speed, sway, rate))
            # The same step as integrate_planar's, which later gives the poses.
            turn = 0.5 * period_s * (last_rate + rate)
            ahead, left = 0.5 * period_s * (last_speed + speed), 0.5 * period_s * (last_sway + sway)
            cos, sin = math.cos(yaw + 0.5 * turn), math.sin(yaw + 0.5 * turn)
            x, y, yaw = x + cos * ahead - sin * left, y + sin * ahead + cos * left, yaw + turn
    states = np.array(states)
    return states[:, :2], states[:, 2]


def _steer(cross_m, course_error_rad, max_rate_radps, dynamics):
    """The yaw rate that leads to the point of the line `lookahead_m` ahead."""
    error_rad = course_error_rad - math.atan2(cross_m, dynamics.lookahead_m)
    rate_radps = dynamics.heading_gain_per_s * math.remainder(error_rad, 2 * math.pi)
    return max(-max_rate_radps, min(max_rate_radps, rate_radps))


def _height_profile(xy_m, terrain, mission, smoothing_samples):
    """z [T] of a vehicle that keeps its altitude over the smoothed seabed below the track."""
    inside_m = np.clip(xy_m, terrain.origin_m, terrain.upper_m)
    seabed_m = terrain.height_m(*inside_m.T)
    if np.isnan(seabed_m).any():
        x, y = inside_m[np.isnan(seabed_m)][0]
        raise SurveyError(
            f"terrain is NaN below the track at x = {x:.1f} m, y = {y:.1f} m; "
            "expected finite heights under the whole swath"
        )
    z_m = gaussian_filter1d(seabed_m, smoothing_samples, mode="nearest") + mission.altitude_m
    if z_m.max() >= 0:
        raise SurveyError(
            f"terrain puts the vehicle at z = {z_m.max():.1f} m for an altitude of "
            f"{mission.altitude_m} m, expected below the surface (z < 0)"
        )
    return z_m


def _attitude(time_s, level_mps, climb_mps, yaw_rate_radps, dynamics, rng):
    """Roll and pitch [T]: leaning into turns, nose up (negative pitch) to climb, oscillations."""
    phases = rng.uniform(0, 2 * np.pi, 4)
    roll_wave = _wave(time_s, dynamics.roll_period_s, phases[:2])
    pitch_wave = _wave(time_s, dynamics.pitch_period_s, phases[2:])
    roll_rad = -dynamics.bank_s * yaw_rate_radps + dynamics.roll_amplitude_rad * roll_wave
    pitch_rad = dynamics.pitch_trim_rad - np.arctan2(climb_mps, level_mps[:, 0])
    return roll_rad, pitch_rad + dynamics.pitch_amplitude_rad * pitch_wave


def _wave(time_s, period_s, phases):
    """Two sines of incommensurate periods, at most 1 together: no fixed rhythm to lock on to."""
    turns = 2 * np.pi * time_s / period_s
    return 0.6 * np.sin(turns + phases[0]) + 0.4 * np.sin(0.618 * turns + phases[1])
