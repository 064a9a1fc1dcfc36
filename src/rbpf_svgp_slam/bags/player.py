"""Plays a survey's bag and says when it is over: by parameters of the player's own namespace.

rosbag play does the work. Its end, not a silence on the topics, is the end of the survey: sensors
pause for minutes, recordings too.
"""

from __future__ import annotations

import argparse
import signal
import subprocess
import sys
from typing import Sequence

import rosgraph
from roslib.packages import find_node

from rbpf_svgp_slam.bags.opening import BagError, open_bag
from rbpf_svgp_slam.bags.topics import TopicError, as_subscribed, topic_in_bag
from rbpf_svgp_slam.processes import end_with_parent
from rbpf_svgp_slam.protocol import names
from rbpf_svgp_slam.protocol.running_nodes import NameTaken, expect_free

#: Messages that rosbag play keeps for a subscriber that is busy: none may be lost on the way.
QUEUE = 10_000
TRANSFORMS = ("/tf", "/tf_static")


def play(arguments: Sequence[str]) -> int | str:
    """Play the bag to its end; returns rosbag play's exit status, 2 if there is nothing to play.

    Or what sys.exit() prints, if another survey is played.
    """
    options = _parse([word for word in arguments if ":=" not in word])
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)
    try:
        expect_free(names.PLAYER)
    except NameTaken as error:
        return f"play_survey: {error}"
    try:
        command = _command(options)
    except (TopicError, BagError) as error:
        return _tell_end(2, f"{error}")
    player = subprocess.Popen(command, preexec_fn=end_with_parent)
    try:
        status = player.wait()
    except KeyboardInterrupt:
        # a second Ctrl-C must not end in a traceback; SIGTERM ends us at once
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        player.send_signal(signal.SIGINT)
        player.wait()
        return 0
    return _tell_end(status, "" if status == 0 else f"rosbag play ended with status {status}")


def _parse(arguments: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="play_survey.py", description=__doc__)
    add = parser.add_argument
    add("bag")
    add("--rate", default="1", help="times real time")
    add("--odometry", required=True, metavar="TOPIC", help="as the filter subscribes to it")
    add("--pings", required=True, metavar="TOPIC")
    add("--fixes", default="fixes", metavar="TOPIC", help="played if the bag has it")
    add("--ground-truth", required=True, metavar="TOPIC", help="played if the bag has it")
    return parser.parse_args(list(arguments))


def _command(options: argparse.Namespace) -> list[str]:
    """rosbag play with the topics that are wanted, each under the name that is subscribed to."""
    with open_bag(options.bag) as bag:
        topics = list(bag.get_type_and_topic_info().topics)
    wanted = [(options.odometry, "odometry"), (options.pings, "pings")]
    played = {
        as_subscribed(n): topic_in_bag(as_subscribed(n), topics, meaning, options.bag)
        for n, meaning in wanted
    }
    optional = (options.fixes, options.ground_truth)
    for name in (*map(as_subscribed, optional), *TRANSFORMS):
        try:
            played[name] = topic_in_bag(name, topics, "", options.bag)
        except TopicError:
            pass  # it is optional
    # in a namespace, too, nodes listen to the one clock
    played_to = {"clock": "/clock", **{topic: name for name, topic in played.items()}}
    remappings = [f"{topic}:={name}" for topic, name in played_to.items() if name != topic]
    # not `rosbag play`, a script that would outlive us if we were killed
    [program] = find_node("rosbag", "play")
    command = [program, "--quiet", "--clock", "--hz", "100", "--queue", str(QUEUE)]
    # It waits until everybody listens, so that the first messages are not lost.
    command += ["--rate", options.rate, "--wait-for-subscribers", "--topics"]
    return [
        *command,
        *played.values(),
        "--bags",
        options.bag,
        f"__name:={names.PLAYER}",
        *remappings,
    ]


def _tell_end(status: int, problem: str) -> int:
    """To whoever waits for the bag's end; the status, which they look for, comes last."""
    namespace = rosgraph.names.get_ros_namespace()
    master = rosgraph.Master(f"{namespace}{names.PLAYER}")
    for name, value in ((names.PLAYER_PROBLEM, problem), (names.PLAYER_STATUS, status)):
        master.setParam(rosgraph.names.ns_join(namespace, name), value)
    if problem:
        print(f"play_survey.py: {problem}", file=sys.stderr, flush=True)
    return status
