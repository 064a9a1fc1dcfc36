"""Good navigation made into dead reckoning that drifts, with the original as ground truth.

As the paper's group has tested: the true track is known then, and how much was put on it.
"""

from __future__ import annotations

import dataclasses
from typing import Sequence

import numpy as np

from rbpf_svgp_slam.bags.recorded_survey import OdometryNoise, Trajectory
from rbpf_svgp_slam.simulation.dead_reckoning import (
    DeadReckoningNoise,
    draw_biases,
    simulate_dead_reckoning,
)


def scaled(noise: DeadReckoningNoise, times: float) -> DeadReckoningNoise:
    """All of its drift so many times as large; depth, roll and pitch stay."""
    white_each_sample = {"depth_m", "attitude_rad"}
    drift = {
        field.name: times * getattr(noise, field.name)
        for field in dataclasses.fields(noise)
        if field.name not in white_each_sample
    }
    return dataclasses.replace(noise, **drift)


def odometry_noise(noise: DeadReckoningNoise) -> OdometryNoise:
    """As an odometry message tells it."""
    names = (field.name for field in dataclasses.fields(OdometryNoise))
    return OdometryNoise(**{name: getattr(noise, name) for name in names})


def degrade_odometry(
    tracks: Sequence[Trajectory], noise: DeadReckoningNoise, seed: int
) -> list[Trajectory]:
    """What dead reckoning of that noise makes of true tracks, which gaps divide.

    Over a gap it moves as the vehicle truly has: nothing was recorded there that could drift.
    """
    rng = np.random.default_rng(seed)
    biases = draw_biases(noise, rng)
    degraded: list[Trajectory] = []
    for number, truth in enumerate(tracks):
        odometry = simulate_dead_reckoning(truth, noise, rng, biases)
        if degraded:
            odometry = _moved(odometry, tracks[number - 1], degraded[-1])
        degraded.append(odometry)
    return degraded


def drift_line(odometry: Trajectory, truth: Trajectory) -> str:
    """What has become of it, for the user."""
    error_m = np.linalg.norm((odometry.position_m - truth.position_m)[:, :2], axis=1)
    rms_m = np.sqrt(np.mean(error_m**2))
    return f"odometry degraded: final error {error_m[-1]:.2f} m, RMSE {rms_m:.2f} m (horizontal)"


def _moved(odometry: Trajectory, truth: Trajectory, estimate: Trajectory) -> Trajectory:
    """By the rigid motion in the plane that takes the end of a true track to the estimate's."""
    turn_rad = estimate.rpy_rad[-1, 2] - truth.rpy_rad[-1, 2]
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    position_m, rpy_rad = odometry.position_m.copy(), odometry.rpy_rad.copy()
    from_end_m = position_m[:, :2] - truth.position_m[-1, :2]
    position_m[:, :2] = estimate.position_m[-1, :2] + from_end_m @ np.array([[c, s], [-s, c]])
    rpy_rad[:, 2] += turn_rad
    return dataclasses.replace(odometry, position_m=position_m, rpy_rad=rpy_rad)
