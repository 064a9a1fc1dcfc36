"""Publishes a picture of how a survey goes; its ATE too, where a recorder knows the truth."""

from __future__ import annotations

import time

import numpy as np
import rospy
from nav_msgs.msg import Path
from sensor_msgs.msg import Image

from rbpf_svgp_slam.display.status_rows import Row, status_rows
from rbpf_svgp_slam.display.text_image import text_image
from rbpf_svgp_slam.metrics.trajectory_errors import ate_rmse
from rbpf_svgp_slam.msg import FilterStatus
from rbpf_svgp_slam.protocol import names
from rbpf_svgp_slam.run.tracks import interpolate_poses

PERIOD_S = 1.0
# Paths have thousands of poses, which take their time to be read.
PATHS_PERIOD_S = 5.0
# Of the ground truth, whose path is thinned in long surveys: gaps of more than so many of its steps
# are not bridged.
GAP_STEPS = 3.0


class Track:
    """A path's topic, read when it is asked for."""

    def __init__(self, topic: str) -> None:
        self._newest: bytes = b""
        rospy.Subscriber(topic, rospy.AnyMsg, self._on_path, queue_size=1)

    def read(self) -> tuple[np.ndarray, np.ndarray]:
        """Stamps [K], s, and poses [K, 6] as in run/tracks.py, the attitudes left at zero."""
        if not self._newest:
            return np.empty(0), np.empty((0, 6))
        poses = Path().deserialize(self._newest).poses
        stamps_s = np.array([pose.header.stamp.to_sec() for pose in poses])
        positions = [pose.pose.position for pose in poses]
        rows = [(at.x, at.y, at.z, 0.0, 0.0, 0.0) for at in positions]
        return stamps_s, np.array(rows).reshape(-1, 6)

    def _on_path(self, message: rospy.AnyMsg) -> None:
        self._newest = message._buff


class StatusDisplay:
    """Topic status_image: an Image of what the filter says, and of the errors as they are known."""

    def __init__(self) -> None:
        self._image = rospy.Publisher(names.STATUS_IMAGE, Image, queue_size=1, latch=True)
        self._status: FilterStatus | None = None
        self._start_s: float | None = None  # stamp of the first ping
        self._ate_m: tuple[float | None, float | None] = (None, None)  # also of dead reckoning
        self._next_paths_s = 0.0  # monotonic
        self._track, self._dead_reckoning, self._truth = (
            Track(topic) for topic in (names.PATH, names.DEAD_RECKONING_PATH, names.TRUTH_PATH)
        )
        rospy.Subscriber(names.FILTER_STATUS, FilterStatus, self._on_status, queue_size=1)

    def spin(self) -> None:
        """Publish until shutdown."""
        while not rospy.is_shutdown():
            time.sleep(PERIOD_S)  # wall time: a bag's clock may stand still
            if self._status is not None and self._image.get_num_connections():
                self._publish(self._status)

    def _on_status(self, status: FilterStatus) -> None:
        self._status = status

    def _publish(self, status: FilterStatus) -> None:
        if time.monotonic() >= self._next_paths_s:
            self._next_paths_s = time.monotonic() + PATHS_PERIOD_S
            self._read_paths()
        pixels = text_image(self._rows(status))
        height, width, _ = pixels.shape
        image = Image(height=height, width=width, encoding="rgb8", step=3 * width)
        image.header.stamp, image.data = status.header.stamp, pixels.tobytes()
        self._image.publish(image)

    def _rows(self, status: FilterStatus) -> list[Row]:
        survey_s = None
        if self._start_s is not None:
            survey_s = max(0.0, status.header.stamp.to_sec() - self._start_s)
        return status_rows(status, survey_s, *self._ate_m)

    def _read_paths(self) -> None:
        stamps_s, poses = self._track.read()
        self._start_s = stamps_s[0] if len(stamps_s) else None
        truth = self._truth.read()
        if len(truth[0]) < 2:
            self._ate_m = (None, None)
            return
        gap_s = GAP_STEPS * float(np.median(np.diff(truth[0])))
        self._ate_m = tuple(
            ate_rmse(track, interpolate_poses(*truth, stamps_s, gap_s))
            for stamps_s, track in ((stamps_s, poses), self._dead_reckoning.read())
        )


def start() -> None:
    """Run the node until shutdown."""
    rospy.init_node("status_display")
    StatusDisplay().spin()
