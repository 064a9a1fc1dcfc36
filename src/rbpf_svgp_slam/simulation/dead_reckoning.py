"""What the vehicle believes: noisy body twists, depth and attitude, and the pose they add up to."""

import dataclasses
import math

import numpy as np

from rbpf_svgp_slam.bags.recorded_survey import Trajectory
from rbpf_svgp_slam.simulation import vehicle


@dataclasses.dataclass(frozen=True)
class DeadReckoningNoise:
    """White noise is given per square root of a second: variance grows by its square each second.

    The biases are constant through a survey and drawn once, with these standard deviations; so is
    the current, as a velocity over ground that an odometry through water knows nothing of.
    """

    surge_m_per_sqrt_s: float = 0.08
    sway_m_per_sqrt_s: float = 0.08
    yaw_rad_per_sqrt_s: float = 0.0025
    surge_scale: float = 0.005  # relative
    gyro_bias_radps: float = 5e-5
    depth_m: float = 0.01  # white, each sample
    attitude_rad: float = math.radians(0.05)  # white, each sample, roll and pitch
    velocity_bias_mps: float = 0.0  # surge and sway
    current_mps: float = 0.0  # to the east and to the north


@dataclasses.dataclass(frozen=True)
class Biases:
    """Of one survey."""

    surge_scale: float  # factor, about 1
    gyro_radps: float
    velocity_mps: np.ndarray  # [2], surge and sway
    current_mps: np.ndarray  # [2], to the east and to the north


def draw_biases(noise, rng):
    """One survey's Biases."""
    scale = 1 + noise.surge_scale * rng.standard_normal()
    gyro_radps = noise.gyro_bias_radps * rng.standard_normal()
    # Not drawn where there are none, so that noise without them draws what it has always drawn.
    velocity_mps, current_mps = (
        std_mps * rng.standard_normal(2) if std_mps else np.zeros(2)
        for std_mps in (noise.velocity_bias_mps, noise.current_mps)
    )
    return Biases(scale, gyro_radps, velocity_mps, current_mps)


def simulate_dead_reckoning(truth, noise, rng, biases=None):
    """The odometry [T] of a vehicle moving along `truth`: a Trajectory in the odom frame.

    Its pose starts at the true one, so odom equals map there; x, y and yaw are the integral of the
    very twists it carries, levelled with the roll and pitch it carries; z, roll and pitch are
    measured. biases: of draw_biases, which draws them if there are none yet.
    """
    samples = len(truth.time_s)
    period_s = truth.time_s[1] - truth.time_s[0]
    biases = biases or draw_biases(noise, rng)

    per_sqrt_s = (noise.surge_m_per_sqrt_s, noise.sway_m_per_sqrt_s, noise.yaw_rad_per_sqrt_s)
    white = rng.standard_normal((samples, 3)) * per_sqrt_s / math.sqrt(period_s)
    to_level = vehicle.levelling_rotation(truth.rpy_rad)
    level_mps = to_level.apply(truth.linear_mps)
    level_mps[:, 0] *= biases.surge_scale
    level_mps[:, :2] += white[:, :2] + biases.velocity_mps
    level_mps[:, :2] -= _seen_from(truth.rpy_rad[:, 2], biases.current_mps)
    yaw_error_radps = np.zeros((samples, 3))
    yaw_error_radps[:, 2] = white[:, 2] + biases.gyro_radps

    rpy_rad = truth.rpy_rad.copy()
    rpy_rad[:, :2] += noise.attitude_rad * rng.standard_normal((samples, 2))
    linear_mps = to_level.inv().apply(level_mps)
    angular_radps = truth.angular_radps + to_level.inv().apply(yaw_error_radps)
    start = (*truth.position_m[0, :2], truth.rpy_rad[0, 2])
    planar = integrate_twist(linear_mps, angular_radps, rpy_rad, start, period_s)
    rpy_rad[:, 2] = planar[:, 2]
    depth_m = truth.position_m[:, 2] + noise.depth_m * rng.standard_normal(samples)
    return Trajectory(
        time_s=truth.time_s,
        position_m=np.column_stack([planar[:, :2], depth_m]),
        rpy_rad=rpy_rad,
        linear_mps=linear_mps,
        angular_radps=angular_radps,
    )


def _seen_from(yaw_rad, velocity_mps):
    """A velocity [2] of the map frame in levelled bodies with these headings [T]: [T, 2]."""
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    east, north = velocity_mps
    return np.column_stack([cos * east + sin * north, cos * north - sin * east])


def integrate_twist(linear_mps, angular_radps, rpy_rad, start, period_s):
    """x, y, yaw [T, 3] from body twists [T, 3] and the roll and pitch in rpy_rad [T, 3]."""
    level_mps = vehicle.levelling_rotation(rpy_rad).apply(linear_mps)
    roll_rad, pitch_rad = rpy_rad[:, 0], rpy_rad[:, 1]
    q, r = angular_radps[:, 1], angular_radps[:, 2]
    # psi' = (q sin(phi) + r cos(phi)) / cos(theta)
    yaw_rate_radps = (q * np.sin(roll_rad) + r * np.cos(roll_rad)) / np.cos(pitch_rad)
    return vehicle.integrate_planar(level_mps[:, :2], yaw_rate_radps, start, period_s)


def horizontal_errors(truth, odometry):
    """The final error and the RMSE over time of the dead-reckoned position, horizontal, m."""
    errors_m = np.linalg.norm((odometry.position_m - truth.position_m)[:, :2], axis=1)
    return errors_m[-1], math.sqrt(np.mean(errors_m**2))
