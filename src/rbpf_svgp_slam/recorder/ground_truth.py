"""The ground truth as it comes in: of several types, and perhaps with faults."""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path
from typing import Any, Callable

import numpy as np
from scipy.spatial.transform import Rotation

from rbpf_svgp_slam.run.tracks import GROUND_TRUTH_GAP_S, interpolate_poses, write_tum

#: Where a message of each type has its pose. Others are refused.
POSE_OF: dict[str, Callable[[Any], Any]] = {
    "nav_msgs/Odometry": lambda message: message.pose.pose,
    "geometry_msgs/PoseStamped": lambda message: message.pose,
    "geometry_msgs/PoseWithCovarianceStamped": lambda message: message.pose.pose,
}
#: Of the quaternion's norm: messages carry rounded numbers.
NORM_TOLERANCE = 0.01


class GroundTruth:
    """A track [x y z roll pitch yaw] in map; what cannot be used is counted, never raised."""

    def __init__(self, map_frame: str) -> None:
        self._map_frame = map_frame
        self._rows: list[tuple[float, ...]] = []
        #: Messages refused, by reason.
        self.refused: Counter[str] = Counter()

    def add(self, message: Any, type_name: str) -> str:
        """Take a message in; returns why it was refused, or an empty string."""
        reason = self._problem(message, type_name)
        if reason:
            self.refused[reason] += 1
            return reason
        pose = POSE_OF[type_name](message)
        p, q = pose.position, pose.orientation
        yaw, pitch, roll = Rotation.from_quat([q.x, q.y, q.z, q.w]).as_euler("ZYX")
        stamp_s = message.header.stamp.to_sec()
        self._rows.append((stamp_s, p.x, p.y, p.z, roll, pitch, yaw))
        return ""

    def track(self) -> np.ndarray | None:
        """Rows [K, 7] of stamp and pose by stamp; none if nothing was taken in."""
        return np.asarray(sorted(self._rows)) if self._rows else None

    def save(self, path: Path) -> None:
        """All poses as a TUM file; nothing if there are none."""
        track = self.track()
        if track is not None:
            _, first = np.unique(track[:, 0], return_index=True)
            write_tum(path, track[first, 0], track[first, 1:])

    def at(self, stamp_s: np.ndarray) -> np.ndarray | None:
        """Poses [P, 6] at stamps [P], NaN where there are none near; none without any track."""
        track = self.track()
        if track is None:
            return None
        return interpolate_poses(track[:, 0], track[:, 1:], stamp_s, GROUND_TRUTH_GAP_S)

    def thinned(self, most: int) -> list[tuple[float, float, float, float]]:
        """Stamp x y z of at most about so many poses, in the order in which they came."""
        return [row[:4] for row in self._rows[:: 1 + len(self._rows) // most]]

    def _problem(self, message: Any, type_name: str) -> str:
        if type_name not in POSE_OF:
            return f"type {type_name}, expected one of {', '.join(POSE_OF)}"
        frame = message.header.frame_id.lstrip("/")
        if frame != self._map_frame:
            return f"frame '{frame}', expected '{self._map_frame}' (frames/map)"
        if message.header.stamp.is_zero():
            return "stamp 0, expected the time of the pose"
        pose = POSE_OF[type_name](message)
        p, q = pose.position, pose.orientation
        if not all(map(math.isfinite, (p.x, p.y, p.z, q.x, q.y, q.z, q.w))):
            return "a pose that is not finite"
        norm = math.hypot(q.x, q.y, q.z, q.w)
        if abs(norm - 1.0) > NORM_TOLERANCE:
            return f"an orientation of norm {norm:.3g}, expected 1"
        return ""
