"""Ground truth that others have, and that is never worth a run."""

from __future__ import annotations

from typing import Any

import rospy
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import NavSatFix

from bag_cases.expected import RIGHT, Case, Expected
from bag_cases.survey import TRUTH, Survey, drop, each


def pose_stamped(survey: Survey) -> Survey:
    def pose(message: Odometry, _: float) -> PoseStamped:
        return PoseStamped(message.header, message.pose.pose)

    return each(survey, TRUTH, pose)


def of_a_wrong_type(survey: Survey) -> Survey:
    return each(survey, TRUTH, lambda m, _: NavSatFix(header=m.header, latitude=58.0))


def in_world(survey: Survey) -> Survey:
    def of_world(message: Any, _: float) -> Any:
        message.header.frame_id = "world"
        return message

    return each(survey, TRUTH, of_world)


def nan_for_a_while(survey: Survey) -> Survey:
    """A tracker that has lost the vehicle."""

    def lost(message: Any, seconds: float) -> Any:
        if 40.0 < seconds < 60.0:
            p = message.pose.pose.position
            p.x = p.y = p.z = float("nan")
        return message

    return each(survey, TRUTH, lost)


def with_gaps(survey: Survey) -> Survey:
    return drop(survey, lambda one, seconds: one.topic == TRUTH and int(seconds / 15.0) % 2 == 1)


def half(survey: Survey) -> Survey:
    return drop(survey, lambda one, seconds: one.topic == TRUTH and seconds > 50.0)


def without_stamps(survey: Survey) -> Survey:
    def unstamped(message: Any, _: float) -> Any:
        message.header.stamp = rospy.Time(0)
        return message

    return each(survey, TRUTH, unstamped)


def none(survey: Survey) -> Survey:
    return drop(survey, lambda one, _: one.topic == TRUTH)


NO_TRUTH = Expected(has_truth=False)
CASES = [
    Case("truth_pose_stamped", "ground truth", "PoseStamped", pose_stamped, RIGHT),
    Case("truth_nan", "ground truth", "20 s of NaN", nan_for_a_while, RIGHT),
    Case("truth_with_gaps", "ground truth", "gaps of 15 s", with_gaps, RIGHT),
    Case("truth_half", "ground truth", "ends halfway", half, RIGHT),
    Case("truth_none", "ground truth", "none", none, NO_TRUTH),
    Case("truth_wrong_type", "ground truth", "NavSatFix", of_a_wrong_type, NO_TRUTH),
    Case("truth_in_world", "ground truth", "in frame world", in_world, NO_TRUTH),
    Case("truth_no_stamps", "ground truth", "stamps of zero", without_stamps, NO_TRUTH),
]
