"""Publishes the seabed of the final trajectory, once, at the end."""

from __future__ import annotations

import numpy as np
import rospy
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from rbpf_svgp_slam.figures.cloud_colours import seabed_rgb
from rbpf_svgp_slam.protocol import names
from rbpf_svgp_slam.protocol.clouds import packed_rgb, point_cloud
from rbpf_svgp_slam.run.survey_run import SurveyRun
from rbpf_svgp_slam.survey_area.grid import grid_points


class SeabedPublisher:
    """Topic map/seabed, latched: x, y, z, standard deviation std, m, and rgb, where beams fell."""

    def __init__(self, frame: str) -> None:
        self._frame = frame
        self._cloud = rospy.Publisher(names.MAP_SEABED, PointCloud2, queue_size=1, latch=True)

    def publish(self, run: SurveyRun) -> None:
        """Nothing where the run has no seabed."""
        seabed = run.seabed
        if seabed is None:
            rospy.logwarn("No seabed of the final trajectory: %s", run.why_no_seabed)
            return
        known = np.isfinite(seabed.mean).ravel()
        x, y = grid_points(seabed.x, seabed.y)[known].T
        z, std = seabed.mean.ravel()[known], np.sqrt(seabed.variance.ravel()[known])
        rgb = packed_rgb(seabed_rgb(seabed.x, seabed.y, seabed.mean).reshape(-1, 3)[known])
        header = Header(stamp=rospy.Time.now(), frame_id=self._frame)
        columns = {"x": x, "y": y, "z": z, "std": std, "rgb": rgb}
        self._cloud.publish(point_cloud(header, columns))
