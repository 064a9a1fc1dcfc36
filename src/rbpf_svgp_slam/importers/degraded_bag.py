"""The command line of degrade_odometry.py: a bag with good navigation, made to drift."""

from __future__ import annotations

import argparse
import copy
import sys
from pathlib import Path
from typing import Any, Sequence

import numpy as np
import rosbag
import rospy
from nav_msgs.msg import Odometry
from scipy.spatial.transform import Rotation

from rbpf_svgp_slam.bags.opening import BagError, open_bag
from rbpf_svgp_slam.bags.recorded_survey import Trajectory, rotation_from_rpy
from rbpf_svgp_slam.bags.topics import TopicError, topic_in_bag
from rbpf_svgp_slam.importers.degrade import degrade_odometry, drift_line, scaled
from rbpf_svgp_slam.importers.sonar_file import ImportProblem
from rbpf_svgp_slam.importers.vehicle_track import FEWEST, GAP_S, join, moving
from rbpf_svgp_slam.simulation.dead_reckoning import DeadReckoningNoise

_DESCRIPTION = """Make drifting dead reckoning of a bag's good navigation, which becomes its
ground_truth: white noise and biases, as simulate_survey.py has them. All else is copied."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit status: 2 for a mistake in the arguments or the bag."""
    options = _parse(argv)
    try:
        _run(options)
    except (ImportProblem, BagError, TopicError, OSError) as error:
        print(f"degrade_odometry.py: error: {error}", file=sys.stderr)
        return 2
    return 0


def _parse(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="degrade_odometry.py", description=_DESCRIPTION)
    add = parser.add_argument
    add("bag", metavar="F.bag", type=Path)
    add("--out", required=True, metavar="DEGRADED.bag", type=Path)
    add("--seed", required=True, type=int, metavar="N", help="of noise and biases")
    add("--drift", type=float, default=1.0, metavar="TIMES", help="of simulate_survey.py's")
    add("--odom", default="/odom", metavar="TOPIC")
    add("--ground-truth", default="/ground_truth", metavar="TOPIC", help="to be written")
    return parser.parse_args(argv)


def _run(options: argparse.Namespace) -> None:
    if options.seed < 0 or not 0 <= options.drift < np.inf:
        raise ImportProblem(
            f"seed is {options.seed}, drift {options.drift}, expected both to be 0 or above"
        )
    if options.out.exists() and options.bag.exists() and options.out.samefile(options.bag):
        raise ImportProblem(f"out is {options.out}, the bag itself, expected another file")
    with open_bag(str(options.bag)) as bag:
        topics = bag.get_type_and_topic_info().topics
        topic = topic_in_bag(options.odom, topics, "odometry", str(options.bag))
        if topics[topic].msg_type != "nav_msgs/Odometry":
            raise ImportProblem(f"{topic} is {topics[topic].msg_type}, expected nav_msgs/Odometry")
        odometry = [(message, time) for _, message, time in bag.read_messages(topics=[topic])]
        tracks = tracks_of([message for message, _ in odometry], topic)
        noise = scaled(DeadReckoningNoise(), options.drift)
        degraded = degrade_odometry(tracks, noise, options.seed)
        options.out.parent.mkdir(parents=True, exist_ok=True)
        with rosbag.Bag(str(options.out), "w", compression=rosbag.Compression.LZ4) as out:
            frames = {odometry[0][0].header.frame_id, odometry[0][0].child_frame_id}
            _copy_others(bag, out, {topic, options.ground_truth}, frames)
            _write(out, topic, odometry, join(degraded), odometry[0][0].header.frame_id)
            _write(out, options.ground_truth, odometry, join(tracks), "map")
    print(f"{options.out}: {drift_line(join(degraded), join(tracks))}")


def tracks_of(messages: Sequence[Any], topic: str) -> list[Trajectory]:
    """Even tracks between gaps, of nav_msgs/Odometry; twists are those that the poses tell."""
    stamps_s = np.array([message.header.stamp.to_sec() for message in messages])
    _, order = np.unique(stamps_s, return_index=True)
    stamps_s = stamps_s[order]
    poses = [messages[k].pose.pose for k in order]
    xyz_m = np.array([(p.position.x, p.position.y, p.position.z) for p in poses])
    quaternions = [(o.x, o.y, o.z, o.w) for o in (p.orientation for p in poses)]
    rpy_rad = np.unwrap(Rotation.from_quat(quaternions).as_euler("ZYX")[:, ::-1], axis=0)
    columns = np.hstack([xyz_m, rpy_rad])
    steps_s = np.diff(stamps_s)
    period_s = np.median(steps_s) if len(steps_s) else np.inf
    tracks = []
    for part in np.split(np.arange(len(stamps_s)), np.flatnonzero(steps_s > GAP_S) + 1):
        steps = int((stamps_s[part[-1]] - stamps_s[part[0]]) / period_s + 1e-6)
        if steps >= FEWEST:
            time_s = stamps_s[part[0]] + period_s * np.arange(steps + 1)
            even = [np.interp(time_s, stamps_s[part], column) for column in columns[part].T]
            tracks.append(moving(time_s, np.stack(even[:3], axis=1), np.stack(even[3:], axis=1)))
    if not tracks:
        raise ImportProblem(f"{topic} has {len(stamps_s)} stamps, expected some seconds of them")
    return tracks


def _copy_others(bag: rosbag.Bag, out: rosbag.Bag, written: set[str], frames: set[str]) -> None:
    """All that stays as it is: not what is written anew, nor the odometry's transforms in /tf."""
    for topic, message, time, header in bag.read_messages(return_connection_header=True):
        if topic.strip("/") in {name.strip("/") for name in written}:
            continue
        if message._type == "tf2_msgs/TFMessage":
            message = copy.copy(message)
            message.transforms = [
                transform
                for transform in message.transforms
                if {transform.header.frame_id, transform.child_frame_id} != frames
            ]
            if not message.transforms:
                continue
        out.write(topic, message, time, connection_header=header)


def _write(
    out: rosbag.Bag, topic: str, odometry: Sequence[Any], track: Trajectory, frame: str
) -> None:
    """The track as Odometry, recorded when the bag's own was; odometry: its messages and times."""
    stamps_s = np.array([message.header.stamp.to_sec() for message, _ in odometry])
    order = np.argsort(stamps_s)
    recorded_s = np.array([time.to_sec() for _, time in odometry])
    times_s = np.interp(track.time_s, stamps_s[order], recorded_s[order])
    message = Odometry()
    message.header.frame_id = frame
    message.child_frame_id = odometry[0][0].child_frame_id
    quaternions = rotation_from_rpy(track.rpy_rad).as_quat()
    for k, time_s in enumerate(track.time_s):
        message.header.seq = k + 1
        message.header.stamp = rospy.Time.from_sec(time_s)
        pose, twist = message.pose.pose, message.twist.twist
        pose.position.x, pose.position.y, pose.position.z = track.position_m[k]
        orientation = pose.orientation
        orientation.x, orientation.y, orientation.z, orientation.w = quaternions[k]
        twist.linear.x, twist.linear.y, twist.linear.z = track.linear_mps[k]
        twist.angular.x, twist.angular.y, twist.angular.z = track.angular_radps[k]
        out.write(topic, message, rospy.Time.from_sec(times_s[k]))
