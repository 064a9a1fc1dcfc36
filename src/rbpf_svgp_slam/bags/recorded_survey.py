"""A survey as a vehicle's payload computer records it, whoever made it: simulator or importer.

Needs no ROS.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.spatial.transform import Rotation


@dataclasses.dataclass(frozen=True)
class Trajectory:
    """Poses of base_link in the map frame and body twists at times that are evenly spaced.

    A recorded one may have gaps. time_s [T] from the start; position_m [T, 3]; rpy_rad [T, 3] roll,
    pitch, yaw (ZYX, yaw not wrapped); linear_mps [T, 3] u, v, w and angular_radps [T, 3] p, q, r in
    the body frame.
    """

    time_s: np.ndarray
    position_m: np.ndarray
    rpy_rad: np.ndarray
    linear_mps: np.ndarray
    angular_radps: np.ndarray

    def poses_at(self, time_s):
        """Positions [N, 3] and attitudes [N, 3] between the samples, at times [N]."""
        columns = np.hstack([self.position_m, self.rpy_rad]).T
        poses = np.stack([np.interp(time_s, self.time_s, column) for column in columns], axis=1)
        return poses[:, :3], poses[:, 3:]


def rotation_from_rpy(rpy_rad):
    """Rotations body -> parent for roll, pitch, yaw [N, 3]."""
    return Rotation.from_euler("ZYX", rpy_rad[:, ::-1])


@dataclasses.dataclass(frozen=True)
class OdometryNoise:
    """Standard deviations of an odometry message; those of motion per square root of a second."""

    surge_m_per_sqrt_s: float
    sway_m_per_sqrt_s: float
    yaw_rad_per_sqrt_s: float
    depth_m: float
    attitude_rad: float  # roll and pitch


@dataclasses.dataclass(frozen=True)
class Mount:
    """The sonar's static mount: its frame in base_link."""

    translation_m: tuple  # x, y, z
    rpy_rad: tuple  # roll, pitch, yaw about fixed axes


@dataclasses.dataclass(frozen=True)
class RecordedSurvey:
    """All that goes into a bag. Times count from `start_s`, seconds since the epoch.

    odometry: in the odom frame; ground_truth: in the map frame, if it is known;
    ping_time_s [P] and P arrays [beams, 3] float32 of points in the sonar's frame, m;
    origin_deg: latitude and longitude (WGS84) of the map frame's origin, if it lies on the earth.
    """

    start_s: int
    odometry: Trajectory
    odometry_noise: OdometryNoise
    mount: Mount
    ping_time_s: np.ndarray
    ping_points_m: list
    ground_truth: Trajectory | None = None
    recorded_by: str = "/simulate_survey"  # name of the node that has published the mount
    origin_deg: tuple[float, float] | None = None
