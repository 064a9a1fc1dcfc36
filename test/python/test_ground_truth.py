"""The ground truth is validated message by message, and what is wrong with it is counted."""

import math

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import NavSatFix

from rbpf_svgp_slam.recorder.ground_truth import GroundTruth


def filled(message, pose, stamp_s=10.0, x=1.0, frame="map", w=1.0):
    message.header.stamp = rospy.Time.from_sec(stamp_s)
    message.header.frame_id = frame
    pose.position.x, pose.position.y, pose.position.z = x, 2.0, -3.0
    pose.orientation.w = w
    return message


def odometry(**changes):
    message = Odometry()
    return filled(message, message.pose.pose, **changes)


@pytest.mark.parametrize("make", [Odometry, PoseStamped, PoseWithCovarianceStamped])
def test_poses_of_several_types_are_taken(make):
    message = make()
    pose = message.pose if make is PoseStamped else message.pose.pose
    truth = GroundTruth("map")
    assert truth.add(filled(message, pose), message._type) == ""
    np.testing.assert_allclose(truth.track(), [[10.0, 1.0, 2.0, -3.0, 0.0, 0.0, 0.0]])
    assert not truth.refused


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"frame": "world"}, "frame 'world', expected 'map'"),
        ({"x": math.nan}, "a pose that is not finite"),
        ({"x": math.inf}, "a pose that is not finite"),
        ({"w": math.nan}, "a pose that is not finite"),
        ({"w": 0.0}, "an orientation of norm 0, expected 1"),
        ({"w": 0.5}, "an orientation of norm 0.5, expected 1"),
        ({"stamp_s": 0.0}, "stamp 0, expected"),
    ],
)
def test_a_bad_message_costs_itself_alone(changes, reason):
    truth = GroundTruth("map")
    assert truth.add(odometry(), Odometry._type) == ""
    assert reason in truth.add(
        odometry(stamp_s=11.0, **changes) if "stamp_s" not in changes else odometry(**changes),
        Odometry._type,
    )
    assert truth.add(odometry(stamp_s=12.0), Odometry._type) == ""
    assert len(truth.track()) == 2
    assert sum(truth.refused.values()) == 1


def test_another_type_is_refused_by_name():
    truth = GroundTruth("map")
    assert "type sensor_msgs/NavSatFix, expected one of" in truth.add(NavSatFix(), NavSatFix._type)
    assert truth.track() is None


def test_a_leading_slash_of_the_frame_is_no_fault():
    truth = GroundTruth("map")
    assert truth.add(odometry(frame="/map"), Odometry._type) == ""


def test_the_track_is_in_the_order_of_stamps():
    truth = GroundTruth("map")
    for stamp_s in (12.0, 10.0, 11.0):
        truth.add(odometry(stamp_s=stamp_s), Odometry._type)
    assert truth.track()[:, 0].tolist() == [10.0, 11.0, 12.0]
    assert len(truth.thinned(2)) == 2


def test_a_gap_is_not_bridged():
    truth = GroundTruth("map")
    for stamp_s in (10.0, 12.0, 20.0, 21.0):
        truth.add(odometry(stamp_s=stamp_s, x=stamp_s), Odometry._type)
    poses = truth.at(np.array([9.0, 11.0, 15.0, 20.5]))
    np.testing.assert_allclose(poses[:, 0], [np.nan, 11.0, np.nan, 20.5])
    assert GroundTruth("map").at(np.array([1.0])) is None
