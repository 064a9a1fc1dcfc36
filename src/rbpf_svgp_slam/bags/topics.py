"""Which topic of a bag is meant by a name that a user gives. Needs no ROS master."""

from __future__ import annotations

from typing import Iterable

import rosgraph.names

from rbpf_svgp_slam.protocol import names


class TopicError(ValueError):
    """The bag has no such topic; the message names those that it has."""


def topic_in_bag(name: str, topics: Iterable[str], meaning: str, bag: str) -> str:
    """The bag's own name of a topic that is given with or without its leading slash or namespace.

    /auv/odom finds /auv/odom, auv/odom or, where a launch file's namespace has been put before
    it, /odom; the longest name that fits counts. meaning, bag: for the message of TopicError.
    """
    given = name.strip("/").split("/")
    by_parts = {tuple(topic.strip("/").split("/")): topic for topic in topics}
    for first in range(len(given)):
        if tuple(given[first:]) in by_parts:
            return by_parts[tuple(given[first:])]
    known = ", ".join(sorted(by_parts.values())) or "none"
    raise TopicError(f"{bag} has no topic {name} for the {meaning}; its topics are {known}")


def as_subscribed(topic: str) -> str:
    """The whole name, by which the filter subscribes to what is given as an argument."""
    namespace = rosgraph.names.get_ros_namespace()
    return rosgraph.names.resolve_name(topic, f"{namespace}{names.PLAYER}")
