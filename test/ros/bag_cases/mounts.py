"""Sensors whose mount is wrong, late, elsewhere or unknown."""

from __future__ import annotations

import copy
from typing import Any, Callable

import numpy as np
import rospy
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import PointCloud2
from tf2_msgs.msg import TFMessage

from bag_cases.clouds import beams, cloud
from bag_cases.expected import RIGHT, Case, finds, refused, stops
from bag_cases.survey import (
    ODOMETRY,
    PINGS,
    TF,
    TF_STATIC,
    Recorded,
    Survey,
    count_spoilt,
    delay_records,
    drop,
    each,
    insert,
)


def _change_mount(survey: Survey, change: Callable[[Any], None]) -> Survey:
    def changed(message: TFMessage, _: float) -> TFMessage:
        change(message.transforms[0].transform)
        return message

    return each(survey, TF_STATIC, changed)


def no_mount(survey: Survey) -> Survey:
    survey = drop(survey, lambda one, _: one.topic == TF_STATIC)
    return count_spoilt(survey, PINGS, len(survey.of(PINGS)))


def mount_in_millimetres(survey: Survey) -> Survey:
    def thousandfold(transform: Any) -> None:
        p = transform.translation
        # a lever arm of 1.2 m ahead, 0.3 m below
        p.x, p.y, p.z = 1200.0, 0.0, -300.0

    survey = _change_mount(survey, thousandfold)
    return count_spoilt(survey, PINGS, len(survey.of(PINGS)))


def mount_not_a_rotation(survey: Survey) -> Survey:
    """Somebody has filled in the quaternion with zeros."""

    def zero(transform: Any) -> None:
        q = transform.rotation
        q.x = q.y = q.z = q.w = 0.0

    survey = _change_mount(survey, zero)
    return count_spoilt(survey, PINGS, len(survey.of(PINGS)))


def mount_changes_midway(survey: Survey, at_s: float = 50.0) -> Survey:
    """The sonar is taken off and put back turned: a second static transform."""
    first = survey.of(TF_STATIC)[0]
    message = copy.deepcopy(first.message)
    q = message.transforms[0].transform.rotation
    turned = Rotation.from_euler("z", 5, degrees=True) * Rotation.from_quat([q.x, q.y, q.z, q.w])
    q.x, q.y, q.z, q.w = turned.as_quat().tolist()
    return insert(survey, [Recorded(TF_STATIC, message, first.time + rospy.Duration(at_s))])


def mount_on_tf(survey: Survey) -> Survey:
    """tf's old static_transform_publisher: on /tf, ten times a second, and no /tf_static."""
    static = survey.of(TF_STATIC)[0].message
    survey = drop(survey, lambda one, _: one.topic == TF_STATIC)
    more = []
    for k in range(int(10 * (survey.recorded[-1].time.to_sec() - survey.begin_s))):
        message, time = copy.deepcopy(static), rospy.Time.from_sec(survey.begin_s + 0.1 * k)
        for transform in message.transforms:
            transform.header.stamp = time
        more.append(Recorded(TF, message, time))
    return insert(survey, more)


def mount_20_s_late(survey: Survey) -> Survey:
    return delay_records(survey, [TF_STATIC], 20.0)


def second_sensor_unmounted(survey: Survey) -> Survey:
    """Every ping comes twice, the second time from a sensor that tf knows nothing of."""

    def also(message: PointCloud2, _: float) -> list[PointCloud2]:
        other = copy.deepcopy(message)
        other.header.frame_id = "mbes_port"
        return [message, other]

    messages = len(survey.of(PINGS))
    return count_spoilt(each(survey, PINGS, also), PINGS, messages)


def pings_in_odom(survey: Survey) -> Survey:
    """Clouds that a driver has already placed in odom, with the odometry's pose."""
    mount = survey.of(TF_STATIC)[0].message.transforms[0].transform
    q, p = mount.rotation, mount.translation
    turn, arm = Rotation.from_quat([q.x, q.y, q.z, q.w]), np.array([p.x, p.y, p.z])
    poses = [one.message for one in survey.of(ODOMETRY)]
    stamps_s = np.array([pose.header.stamp.to_sec() for pose in poses])

    def placed(message: PointCloud2, _: float) -> PointCloud2:
        nearest = np.searchsorted(stamps_s, message.header.stamp.to_sec())
        pose = poses[min(nearest, len(poses) - 1)].pose.pose
        r, at = pose.orientation, pose.position
        in_base = turn.apply(beams(message)) + arm
        in_odom = Rotation.from_quat([r.x, r.y, r.z, r.w]).apply(in_base) + [at.x, at.y, at.z]
        out = cloud(message, in_odom)
        out.header.frame_id = "odom"
        return out

    return each(survey, PINGS, placed)


CASES = [
    Case(
        "mount_in_millimetres",
        "mounts",
        "a lever arm of 1200",
        mount_in_millimetres,
        stops("pings/implausible_mount", "1[,.]?2"),
    ),
    Case(
        "mount_not_a_rotation",
        "mounts",
        "a mount whose quaternion is zero",
        mount_not_a_rotation,
        stops("pings/(no_mount|implausible_mount)"),
    ),
    Case(
        "mount_changes",
        "mounts",
        "the mount turns by 5° midway",
        mount_changes_midway,
        finds("mount_changed"),
    ),
    Case("mount_on_tf", "mounts", "the mount on /tf, ten times a second", mount_on_tf, RIGHT),
    Case("mount_20_s_late", "mounts", "the mount comes after 20 s", mount_20_s_late, RIGHT),
    Case("no_mount", "mounts", "no mount at all", no_mount, stops("pings/no_mount")),
    Case(
        "second_sensor_unmounted",
        "mounts",
        "two sensors on one topic, one without mount",
        second_sensor_unmounted,
        refused("pings/no_mount"),
    ),
    Case(
        "pings_in_odom",
        "mounts",
        "pings placed in odom by their driver",
        pings_in_odom,
        RIGHT,
    ),
]
