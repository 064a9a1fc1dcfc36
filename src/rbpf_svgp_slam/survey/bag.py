"""Writes a simulated survey as a rosbag, as a vehicle's payload computer would have recorded it."""

import numpy as np
import rosbag
import rospy
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import PointCloud2, PointField
from tf2_msgs.msg import TFMessage

from rbpf_svgp_slam.survey import sonar
from rbpf_svgp_slam.survey.vehicle import rotation_from_rpy

START_S = 1_700_000_000  # any fixed time: the same survey gives the same bag


def write_bag(path, survey, progress=lambda share: None):
    """Write all topics to `path` in the order of their stamps, which are also the record times."""
    sources = [
        _odometry_source(survey.odometry, survey.mission.dead_reckoning),
        _transform_source(survey.odometry),
        _ground_truth_source(survey.truth, survey.mission),
        _ping_source(survey.pings),
    ]
    times_s = np.concatenate([time_s for _, time_s, _ in sources])
    owner = np.repeat(np.arange(len(sources)), [len(time_s) for _, time_s, _ in sources])
    order = np.argsort(times_s, kind="stable")
    with rosbag.Bag(path, "w", compression=rosbag.Compression.LZ4) as bag:
        _write_mount(bag)
        makers = [(topic, iter(messages)) for topic, _, messages in sources]
        for count, index in enumerate(order):
            topic, messages = makers[owner[index]]
            message = next(messages)
            stamped = message.transforms[0] if topic == "/tf" else message
            bag.write(topic, message, stamped.header.stamp)
            if count % 5000 == 0:
                progress(count / len(order))
    progress(1.0)


def _stamp(time_s):
    return rospy.Time(START_S, int(round(1e9 * time_s)))


def _write_mount(bag):
    """/tf_static, marked as latched so that `rosbag play` offers it to late subscribers too."""
    transform = _transform("base_link", "mbes")
    transform.header.stamp = _stamp(0.0)
    quaternion = Rotation.from_euler("xyz", sonar.MOUNT_RPY_RAD).as_quat()
    _set_vector(transform.transform.translation, sonar.MOUNT_TRANSLATION_M)
    _set_quaternion(transform.transform.rotation, quaternion)
    connection = {
        "topic": "/tf_static",
        "type": TFMessage._type,
        "md5sum": TFMessage._md5sum,
        "message_definition": TFMessage._full_text,
        "callerid": "/simulate_survey",
        "latching": "1",
    }
    message = TFMessage([transform])
    bag.write("/tf_static", message, transform.header.stamp, connection_header=connection)


# Each source is (topic, stamps [N], N messages in that order). The messages of a source are one
# object, filled anew each time: writing a bag serialises them at once.


def _odometry_source(odometry, noise):
    period_s = odometry.time_s[1] - odometry.time_s[0]
    message = _odometry_message("odom")
    twist_variance = np.zeros(6)
    twist_variance[:2] = noise.surge_m_per_sqrt_s**2, noise.sway_m_per_sqrt_s**2
    twist_variance[5] = noise.yaw_rad_per_sqrt_s**2
    # White noise of so much per sqrt(s) has this variance in each sample; the exact ones get 1e-6.
    twist_variance = np.maximum(twist_variance / period_s, 1e-6)
    message.twist.covariance = np.diag(twist_variance).ravel().tolist()

    def messages():
        for time_s, filled in zip(odometry.time_s, _poses(message, odometry)):
            filled.pose.covariance = _pose_covariance(time_s, noise)
            yield filled

    return "/odom", odometry.time_s, messages()


def _pose_covariance(time_s, noise):
    """Row-major 6 x 6 over x, y, z, roll, pitch, yaw: x, y and yaw grow with time."""
    planar = max(noise.surge_m_per_sqrt_s, noise.sway_m_per_sqrt_s) ** 2 * time_s
    attitude = noise.attitude_rad**2
    yaw = noise.yaw_rad_per_sqrt_s**2 * time_s
    covariance = [0.0] * 36
    covariance[::7] = [planar, planar, noise.depth_m**2, attitude, attitude, yaw]
    return covariance


def _transform_source(odometry):
    transform = _transform("odom", "base_link")
    message = TFMessage([transform])
    quaternions = rotation_from_rpy(odometry.rpy_rad).as_quat().tolist()
    positions_m = odometry.position_m.tolist()

    def messages():
        for seq, time_s in enumerate(odometry.time_s):
            transform.header.seq = seq + 1
            transform.header.stamp = _stamp(time_s)
            _set_vector(transform.transform.translation, positions_m[seq])
            _set_quaternion(transform.transform.rotation, quaternions[seq])
            yield message

    return "/tf", odometry.time_s, messages()


def _ground_truth_source(truth, mission):
    every = round(mission.odometry_rate_hz / mission.ground_truth_rate_hz)
    message = _odometry_message("map")
    return "/ground_truth", truth.time_s[::every], _poses(message, truth, every)


def _ping_source(pings):
    message = PointCloud2()
    message.header.frame_id = "mbes"
    message.height = 1
    message.point_step = 12
    message.fields = [
        PointField(name, 4 * column, PointField.FLOAT32, 1) for column, name in enumerate("xyz")
    ]

    def messages():
        for seq, (time_s, points_m) in enumerate(zip(pings.time_s, pings.points_m)):
            message.header.seq = seq + 1
            message.header.stamp = _stamp(time_s)
            message.width = len(points_m)
            message.row_step = message.width * message.point_step
            message.is_dense = not np.isnan(points_m).any()
            message.data = points_m.astype("<f4").tobytes()
            yield message

    return "/mbes/pings", pings.time_s, messages()


def _poses(message, trajectory, every=1):
    """The Odometry message with the pose and twist of every n-th sample of the trajectory."""
    quaternions = rotation_from_rpy(trajectory.rpy_rad).as_quat().tolist()
    positions_m = trajectory.position_m.tolist()
    linear_mps, angular_radps = trajectory.linear_mps.tolist(), trajectory.angular_radps.tolist()
    for seq, k in enumerate(range(0, len(positions_m), every)):
        message.header.seq = seq + 1
        message.header.stamp = _stamp(trajectory.time_s[k])
        _set_vector(message.pose.pose.position, positions_m[k])
        _set_quaternion(message.pose.pose.orientation, quaternions[k])
        _set_vector(message.twist.twist.linear, linear_mps[k])
        _set_vector(message.twist.twist.angular, angular_radps[k])
        yield message


def _odometry_message(frame_id):
    message = Odometry()
    message.header.frame_id = frame_id
    message.child_frame_id = "base_link"
    return message


def _transform(parent, child):
    transform = TransformStamped()
    transform.header.frame_id = parent
    transform.child_frame_id = child
    return transform


def _set_vector(target, values):
    target.x, target.y, target.z = values


def _set_quaternion(target, values):
    target.x, target.y, target.z, target.w = values
