"""Writes a recorded survey as a rosbag: the topics and frames that the filter expects."""

import numpy as np
import rosbag
import rospy
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import NavSatFix, NavSatStatus, PointCloud2, PointField
from tf2_msgs.msg import TFMessage

from rbpf_svgp_slam.bags.recorded_survey import rotation_from_rpy

#: Of the ground truth, where the odometry comes faster.
GROUND_TRUTH_RATE_HZ = 10.0


def write_bag(path, survey, progress=lambda share: None):
    """Write all topics to `path` in the order of their stamps, which are also the record times."""
    sources = [
        _odometry_source(survey),
        _transform_source(survey),
        _ping_source(survey),
    ]
    if survey.ground_truth is not None:
        # before the pings: of messages of one stamp the order in the bag stays
        sources.insert(2, _ground_truth_source(survey))
    times_s = np.concatenate([time_s for _, time_s, _ in sources])
    owner = np.repeat(np.arange(len(sources)), [len(time_s) for _, time_s, _ in sources])
    order = np.argsort(times_s, kind="stable")
    with rosbag.Bag(path, "w", compression=rosbag.Compression.LZ4) as bag:
        _write_mount(bag, survey)
        if survey.origin_deg is not None:
            _write_origin(bag, survey)
        makers = [(topic, iter(messages)) for topic, _, messages in sources]
        for count, index in enumerate(order):
            topic, messages = makers[owner[index]]
            message = next(messages)
            stamped = message.transforms[0] if topic == "/tf" else message
            bag.write(topic, message, stamped.header.stamp)
            if count % 5000 == 0:
                progress(count / len(order))
    progress(1.0)


def _stamp(survey, time_s):
    return rospy.Time(survey.start_s, int(round(1e9 * time_s)))


def _write_mount(bag, survey):
    transform = _transform("base_link", "mbes")
    transform.header.stamp = _stamp(survey, survey.odometry.time_s[0])
    quaternion = Rotation.from_euler("xyz", survey.mount.rpy_rad).as_quat()
    _set_vector(transform.transform.translation, survey.mount.translation_m)
    _set_quaternion(transform.transform.rotation, quaternion)
    _write_latched(bag, survey, "/tf_static", TFMessage([transform]), transform.header.stamp)


def _write_origin(bag, survey):
    """Where the map frame's origin lies on the earth; its z = 0 is the sea's surface."""
    message = NavSatFix()
    message.header.frame_id = "map"
    message.header.stamp = _stamp(survey, survey.odometry.time_s[0])
    message.status.status = NavSatStatus.STATUS_FIX
    message.latitude, message.longitude = survey.origin_deg
    _write_latched(bag, survey, "/survey_origin", message, message.header.stamp)


def _write_latched(bag, survey, topic, message, stamp):
    """Marked as latched, so that `rosbag play` offers it to late subscribers too."""
    connection = {
        "topic": topic,
        "type": message._type,
        "md5sum": message._md5sum,
        "message_definition": message._full_text,
        "callerid": survey.recorded_by,
        "latching": "1",
    }
    bag.write(topic, message, stamp, connection_header=connection)


# Each source is (topic, stamps [N], N messages in that order). The messages of a source are one
# object, filled anew each time: writing a bag serialises them at once.


def _odometry_source(survey):
    odometry, noise = survey.odometry, survey.odometry_noise
    period_s = odometry.time_s[1] - odometry.time_s[0]
    message = _odometry_message("odom")
    twist_variance = np.zeros(6)
    twist_variance[:2] = noise.surge_m_per_sqrt_s**2, noise.sway_m_per_sqrt_s**2
    twist_variance[5] = noise.yaw_rad_per_sqrt_s**2
    # White noise of so much per sqrt(s) has this variance in each sample; the exact ones get 1e-6.
    twist_variance = np.maximum(twist_variance / period_s, 1e-6)
    message.twist.covariance = np.diag(twist_variance).ravel().tolist()

    def messages():
        for time_s, filled in zip(odometry.time_s, _poses(survey, message, odometry)):
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


def _transform_source(survey):
    odometry = survey.odometry
    transform = _transform("odom", "base_link")
    message = TFMessage([transform])
    quaternions = rotation_from_rpy(odometry.rpy_rad).as_quat().tolist()
    positions_m = odometry.position_m.tolist()

    def messages():
        for seq, time_s in enumerate(odometry.time_s):
            transform.header.seq = seq + 1
            transform.header.stamp = _stamp(survey, time_s)
            _set_vector(transform.transform.translation, positions_m[seq])
            _set_quaternion(transform.transform.rotation, quaternions[seq])
            yield message

    return "/tf", odometry.time_s, messages()


def _ground_truth_source(survey):
    truth = survey.ground_truth
    every = max(1, round(1.0 / (truth.time_s[1] - truth.time_s[0]) / GROUND_TRUTH_RATE_HZ))
    message = _odometry_message("map")
    return "/ground_truth", truth.time_s[::every], _poses(survey, message, truth, every)


def _ping_source(survey):
    message = PointCloud2()
    message.header.frame_id = "mbes"
    message.height = 1
    message.point_step = 12
    message.fields = [
        PointField(name, 4 * column, PointField.FLOAT32, 1) for column, name in enumerate("xyz")
    ]

    def messages():
        for seq, (time_s, points_m) in enumerate(zip(survey.ping_time_s, survey.ping_points_m)):
            message.header.seq = seq + 1
            message.header.stamp = _stamp(survey, time_s)
            message.width = len(points_m)
            message.row_step = message.width * message.point_step
            message.is_dense = not np.isnan(points_m).any()
            message.data = points_m.astype("<f4").tobytes()
            yield message

    return "/mbes/pings", survey.ping_time_s, messages()


def _poses(survey, message, trajectory, every=1):
    """The Odometry message with the pose and twist of every n-th sample of the trajectory."""
    quaternions = rotation_from_rpy(trajectory.rpy_rad).as_quat().tolist()
    positions_m = trajectory.position_m.tolist()
    linear_mps, angular_radps = trajectory.linear_mps.tolist(), trajectory.angular_radps.tolist()
    for seq, k in enumerate(range(0, len(positions_m), every)):
        message.header.seq = seq + 1
        message.header.stamp = _stamp(survey, trajectory.time_s[k])
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
