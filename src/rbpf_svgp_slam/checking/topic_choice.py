"""Which of a bag's topics are the odometry, the pings and the ground truth. Needs no ROS master."""

from __future__ import annotations

import re
from typing import Callable

from rbpf_svgp_slam.bags.topics import TopicError, as_subscribed, topic_in_bag
from rbpf_svgp_slam.checking.facts import ChosenTopics, Topic
from rbpf_svgp_slam.checking.findings import ERROR, OK, WARNING, Finding

_TRUTH = re.compile(r"truth|(^|[/_])gt([/_]|$)|reference", re.IGNORECASE)
_ODOMETRY = re.compile(r"odom|nav|dead_?reck|ekf|pose", re.IGNORECASE)
_PINGS = re.compile(
    r"ping|mbes|multibeam|swath|bathy|norbit|kongsberg|reson|detections|soundings", re.IGNORECASE
)
_TYPES = {
    "odometry": "nav_msgs/Odometry",
    "pings": "sensor_msgs/PointCloud2 or sensor_msgs/LaserScan, one message a ping",
}
_ARGUMENTS = {"odometry": "--odom", "pings": "--pings"}


def choose_topics(
    topics: list[Topic], odometry: str = "", pings: str = "", ground_truth: str = ""
) -> tuple[ChosenTopics, list[Finding]]:
    """The topics that are named or, where none is, those that look most like it."""
    filled = [topic for topic in topics if topic.messages > 0]
    truths = [topic for topic in filled if topic.is_odometry and _TRUTH.search(topic.name)]
    odometries = [topic for topic in filled if topic.is_odometry and topic not in truths]
    clouds = [topic for topic in filled if topic.is_pings]
    truth = _named(ground_truth, filled) if ground_truth else next(iter(truths), None)
    odometry_topic, of_odometry = _choose("odometry", odometry, odometries, topics, _ODOMETRY)
    ping_topic, of_pings = _choose("pings", pings, clouds, topics, _PINGS)
    return ChosenTopics(odometry_topic, ping_topic, truth), [of_odometry, of_pings]


def _choose(
    meaning: str,
    given: str,
    candidates: list[Topic],
    topics: list[Topic],
    pattern: re.Pattern[str],
) -> tuple[Topic | None, Finding]:
    name, expected = f"{meaning}_topic", _TYPES[meaning]
    others = ", ".join(f"{topic.name} ({topic.type})" for topic in topics) or "none"
    if given:
        topic = _named(given, topics)
        if topic is None:
            like = ", ".join(topic.name for topic in candidates)
            fix = f"{like} could be meant" if like else f"record {meaning} of that type"
            return None, Finding(
                name, ERROR, f"no topic {given}", expected, f"the bag's topics are {others}", fix
            )
        if not (topic.is_odometry if meaning == "odometry" else topic.is_pings):
            cause = "the topic is another, or its type comes from another version of its package"
            return None, Finding(name, ERROR, f"{given} is {topic.type}", expected, cause)
    else:
        topic = max(candidates, key=_likeness(pattern), default=None)
        if topic is None:
            fix = f"record {meaning} of that type, or convert them"
            return None, Finding(
                name, ERROR, "no topic of the type", expected, f"the bag's topics are {others}", fix
            )
    if topic.messages == 0:
        return None, Finding(name, ERROR, f"{topic.name} has no message", expected)
    value = f"{topic.name} ({topic.type}), {topic.messages} messages"
    rest = [other.name for other in candidates if other is not topic]
    if given or not rest:
        return topic, Finding(name, OK, value)
    fix = f"if another is meant: {_ARGUMENTS[meaning]} TOPIC"
    return topic, Finding(name, WARNING, f"{value}; or {', '.join(rest)}?", "one topic", fix=fix)


def _named(given: str, topics: list[Topic]) -> Topic | None:
    by_name = {topic.name: topic for topic in topics}
    try:
        return by_name[topic_in_bag(as_subscribed(given), by_name, "topic", "the bag")]
    except TopicError:
        return None


def _likeness(pattern: re.Pattern[str]) -> Callable[[Topic], tuple[bool, bool, float]]:
    """Names that fit before others; of a vehicle before those of none; then the faster one."""
    return lambda topic: (
        bool(pattern.search(topic.name)),
        topic.child_frame == "base_link",
        topic.rate_hz,
    )
