"""Bags as other people record them: other names, an empty twist, a sonar of z down.

x forward, y starboard, z down in the sonar's frame `norbit`, with a mount that turns it round;
fields x y z intensity; odometry at 50 Hz in `map`, whose twist is all zeros.
"""

import numpy as np
import rosbag
import rospy
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import PointCloud2, PointField
from tf2_msgs.msg import TFMessage

ODOMETRY, PINGS, TRUTH = "/nav/processed/odometry", "/norbit/detections", "/truth"
START_S = 1_650_000_000.0
SPEED_MPS, ODOMETRY_HZ, DEPTH_M = 2.0, 50.0, 12.0
LINE_M, APART_M = 30.0, 4.0


def write_outsider_bag(
    path, duration_s=100.0, ping_hz=4.0, beams=512, pings=True, mount=True, drift_m=0.06
):
    """Lines to and fro over a wavy seabed; drift_m: of the odometry, per sqrt(s)."""
    time_s = np.arange(0.0, duration_s, 1 / ODOMETRY_HZ)
    x, y, yaw = _track(time_s)
    rng = np.random.default_rng(3)
    walk = np.cumsum(rng.normal(0.0, drift_m / np.sqrt(ODOMETRY_HZ), (2, len(time_s))), axis=1)
    angles = np.deg2rad(np.linspace(-60.0, 60.0, beams))
    with rosbag.Bag(str(path), "w") as bag:
        if mount:
            bag.write("/tf_static", TFMessage([_mount()]), _stamp(0.0))
        for k, t in enumerate(time_s):
            stamp = _stamp(t)
            here = x[k] + walk[0, k], y[k] + walk[1, k], yaw[k]
            bag.write(ODOMETRY, _pose(stamp, *here), stamp)
            if k % 10 == 0:
                bag.write(TRUTH, _pose(stamp, x[k], y[k], yaw[k]), stamp)
            if pings and k and k % round(ODOMETRY_HZ / ping_hz) == 0:
                bag.write(PINGS, _ping(stamp, x[k], y[k], yaw[k], angles), stamp)


def _track(time_s):
    lines = int(np.ceil(SPEED_MPS * time_s[-1] / LINE_M)) + 1
    corners = [
        (along, APART_M * k)
        for k in range(lines)
        for along in ((0.0, LINE_M) if k % 2 == 0 else (LINE_M, 0.0))
    ]
    way_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    # rounded corners
    kernel = np.ones(151) / 151
    x, y = (
        np.convolve(np.pad(np.interp(SPEED_MPS * time_s, way_m, c), 75, "edge"), kernel, "valid")
        for c in zip(*corners)
    )
    return x, y, np.unwrap(np.arctan2(np.gradient(y), np.gradient(x)))


def seabed(x, y):
    """z of a wavy seabed, m."""
    return -DEPTH_M + 0.5 * np.sin(x / 3.0) + 0.7 * np.cos(y / 5.0)


def _stamp(time_s):
    return rospy.Time.from_sec(START_S + time_s)


def _mount():
    mount = TransformStamped()
    mount.header.frame_id, mount.child_frame_id = "base_link", "norbit"
    mount.header.stamp = _stamp(0.0)
    mount.transform.translation.x, mount.transform.translation.z = 0.3, -0.6
    mount.transform.rotation.x = 1.0
    return mount


def _pose(stamp, x, y, yaw):
    message = Odometry()
    message.header.stamp, message.header.frame_id = stamp, "map"
    message.child_frame_id = "base_link"
    message.pose.pose.position.x, message.pose.pose.position.y = x, y
    message.pose.pose.orientation.z = np.sin(yaw / 2)
    message.pose.pose.orientation.w = np.cos(yaw / 2)
    return message


def _ping(stamp, x, y, yaw, angles):
    """Beams to where the seabed is below the track; the fan is level."""
    across = DEPTH_M * np.tan(angles)  # to starboard
    at = x + 0.3 * np.cos(yaw) + across * np.sin(yaw), y + 0.3 * np.sin(yaw) - across * np.cos(yaw)
    down = -0.6 - seabed(*at)
    points = np.stack([0 * across, across, down, 40 + 0 * across], axis=1).astype("<f4")
    message = PointCloud2()
    message.header.stamp, message.header.frame_id = stamp, "norbit"
    message.height, message.width, message.point_step = 1, len(points), 16
    message.row_step = message.width * message.point_step
    message.fields = [
        PointField(name, 4 * k, PointField.FLOAT32, 1)
        for k, name in enumerate(("x", "y", "z", "intensity"))
    ]
    message.data = points.tobytes()
    return message
