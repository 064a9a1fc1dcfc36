"""Names of frames and topics, as others write them."""

from __future__ import annotations

from typing import Any

from bag_cases.expected import RIGHT, Case, stops
from bag_cases.survey import ODOMETRY, PINGS, TF, TF_STATIC, TRUTH, Survey, count_spoilt, each

NAMESPACE = "auv"


def slashed_ping_frame(survey: Survey) -> Survey:
    def slashed(message: Any, _: float) -> Any:
        message.header.frame_id = "/" + message.header.frame_id
        return message

    return each(survey, PINGS, slashed)


def slashed_frames(survey: Survey) -> Survey:
    """As tf1 wrote them, in all messages."""

    def slashed(message: Any, _: float) -> Any:
        message.header.frame_id = "/" + message.header.frame_id
        if hasattr(message, "child_frame_id"):
            message.child_frame_id = "/" + message.child_frame_id
        return message

    def slashed_transforms(message: Any, seconds: float) -> Any:
        for transform in message.transforms:
            slashed(transform, seconds)
        return message

    for topic in (ODOMETRY, PINGS, TRUTH):
        survey = each(survey, topic, slashed)
    for topic in (TF, TF_STATIC):
        survey = each(survey, topic, slashed_transforms)
    return survey


def child_frame_empty(survey: Survey) -> Survey:
    def childless(message: Any, _: float) -> Any:
        message.child_frame_id = ""
        return message

    return each(survey, ODOMETRY, childless)


def child_frame_of_another(survey: Survey) -> Survey:
    """The navigation gives the motion of its own housing."""

    def of_the_ins(message: Any, _: float) -> Any:
        message.child_frame_id = "ins"
        return message

    messages = len(survey.of(ODOMETRY))
    return count_spoilt(each(survey, ODOMETRY, of_the_ins), ODOMETRY, messages)


def odometry_in_map(survey: Survey) -> Survey:
    def in_map(message: Any, _: float) -> Any:
        message.header.frame_id = "map"
        return message

    return each(survey, ODOMETRY, in_map)


def _renamed(survey: Survey, topics: dict[str, str]) -> Survey:
    recorded = (one._replace(topic=topics.get(one.topic, one.topic)) for one in survey.recorded)
    return survey.replace(recorded=tuple(recorded), ping_topic=topics[PINGS])


def bag_without_slashes(survey: Survey) -> Survey:
    return _renamed(survey, {topic: topic[1:] for topic in (ODOMETRY, PINGS, TRUTH, TF)})


def asked_without_slashes(survey: Survey) -> Survey:
    names = f"odom_topic:={ODOMETRY[1:]}", f"ping_topic:={PINGS[1:]}"
    return survey.replace(arguments=(*names, f"ground_truth_topic:={TRUTH[1:]}"))


def other_topics(survey: Survey) -> Survey:
    """A vehicle's own names, given as the launch file's arguments."""
    topics = {ODOMETRY: "/nav/odometry", PINGS: "/norbit/detections", TRUTH: "/gps/track"}
    asked = zip(("odom_topic", "ping_topic", "ground_truth_topic"), topics.values())
    arguments = tuple(f"{argument}:={topic}" for argument, topic in asked)
    return _renamed(survey, topics).replace(arguments=arguments)


def in_a_namespace(survey: Survey) -> Survey:
    """Vehicle and launch file are in one, and the topics are asked for by their own names."""
    topics = {topic: f"/{NAMESPACE}{topic}" for topic in (ODOMETRY, PINGS, TRUTH)}
    survey = asked_without_slashes(_renamed(survey, topics))
    return survey.replace(namespace=NAMESPACE)


def misspelt_topic(survey: Survey) -> Survey:
    return survey.replace(arguments=("ping_topic:=/mbes/ping",))


CASES = [
    Case("slashed_ping_frame", "names", "pings in /mbes", slashed_ping_frame, RIGHT),
    Case("slashed_frames", "names", "all frames with a slash", slashed_frames, RIGHT),
    Case(
        "bag_without_slashes",
        "names",
        "topics without slash in the bag",
        bag_without_slashes,
        RIGHT,
    ),
    Case(
        "asked_without_slashes",
        "names",
        "topics without slash as arguments",
        asked_without_slashes,
        RIGHT,
    ),
    Case("other_topics", "names", "other topics, given as arguments", other_topics, RIGHT),
    Case("in_a_namespace", "names", "launch file and topics in a namespace", in_a_namespace, RIGHT),
    Case("odometry_in_map", "names", "odometry in frame map", odometry_in_map, RIGHT),
    Case(
        "child_frame_empty",
        "names",
        "no child_frame_id",
        child_frame_empty,
        RIGHT,
    ),
    Case(
        "child_frame_of_another",
        "names",
        "the motion of another frame",
        child_frame_of_another,
        stops("odometry/wrong_frame", "child_frame_id is 'ins'"),
    ),
    Case(
        "misspelt_topic",
        "names",
        "a topic that the bag does not have",
        misspelt_topic,
        stops("/mbes/ping[^s]", "/mbes/pings"),
    ),
]
