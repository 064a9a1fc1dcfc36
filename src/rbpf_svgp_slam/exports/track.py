"""The final trajectory, placed on the earth."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rbpf_svgp_slam.exports.exported_run import ExportedRun
from rbpf_svgp_slam.charts.georeference import Georeference
from rbpf_svgp_slam.run.planar_poses import wrapped


@dataclass
class Track:
    """K poses of base_link, those of the pings that have one."""

    georeference: Georeference
    stamp_s: np.ndarray  # [K] UNIX time, UTC
    poses: np.ndarray  # [K, 6] x y z roll pitch yaw in map, m, rad
    covariance: np.ndarray | None  # [K, 6] in map: xx, xy, x yaw, yy, y yaw, yaw yaw

    @classmethod
    def of(cls, run: ExportedRun, georeference: Georeference) -> Track:
        """The poses that are known."""
        known = np.isfinite(run.poses).all(axis=1)
        covariance = None if run.covariance is None else run.covariance[known]
        return cls(georeference, run.stamp_s[known], run.poses[known], covariance)

    @cached_property
    def places_deg(self) -> np.ndarray:
        """[K, 2] latitude, longitude."""
        return self.georeference.geographic(self.poses[:, :2])

    @cached_property
    def heading_rad(self) -> np.ndarray:
        """[K] clockwise from true north, in [0, 2π)."""
        return self.georeference.heading_rad(self.poses[:, :2], self.poses[:, 5])

    @cached_property
    def projected_poses(self) -> np.ndarray:
        """[K, 6] easting, northing, z, roll, pitch, yaw anticlockwise from the grid's east."""
        en = self.georeference.projected(self.poses[:, :2])
        yaw = wrapped(self.poses[:, 5] + self._turn_rad)
        return np.column_stack([en, self.poses[:, 2:5], yaw])

    @cached_property
    def projected_covariance(self) -> np.ndarray | None:
        """[K, 6] of easting, northing and yaw: ee, en, e yaw, nn, n yaw, yaw yaw."""
        if self.covariance is None:
            return None
        xx, xy, x_yaw, yy, y_yaw, yaw = self.covariance.T
        cos, sin = np.cos(self._turn_rad), np.sin(self._turn_rad)
        turn = np.moveaxis(np.array([[cos, -sin], [sin, cos]]), -1, 0)
        position = np.moveaxis(np.array([[xx, xy], [xy, yy]]), -1, 0)
        # R C Rᵀ, and R c of the covariances with yaw.
        (ee, en), (_, nn) = np.moveaxis(turn @ position @ turn.transpose(0, 2, 1), 0, -1)
        e_yaw, n_yaw = cos * x_yaw - sin * y_yaw, sin * x_yaw + cos * y_yaw
        return np.column_stack([ee, en, e_yaw, nn, n_yaw, yaw])

    @cached_property
    def utc(self) -> list[str]:
        """[K] ISO 8601, to the microsecond."""
        microseconds = np.round(self.stamp_s * 1e6).astype(np.int64)
        return [f"{text}Z" for text in microseconds.astype("datetime64[us]").astype(str)]

    @cached_property
    def _turn_rad(self) -> np.ndarray:
        return self.georeference.turn_to_grid_rad(self.poses[:, :2])
