"""A recorded survey in memory, and the steps that all cases are made of.

Nothing here changes a survey: every step returns another one.
"""

from __future__ import annotations

import copy
import dataclasses
from collections import Counter
from pathlib import Path
from typing import Any, Callable, Iterable, NamedTuple

import rosbag
import rospy
import yaml
from tf2_msgs.msg import TFMessage

ODOMETRY, PINGS, TRUTH = "/odom", "/mbes/pings", "/ground_truth"
TF, TF_STATIC = "/tf", "/tf_static"
#: What refusals are counted under.
INPUT_OF = {ODOMETRY: "odometry", PINGS: "pings"}


class Recorded(NamedTuple):
    topic: str
    message: Any
    time: rospy.Time  # of the recording


@dataclasses.dataclass(frozen=True)
class Survey:
    recorded: tuple[Recorded, ...]
    overlay: dict[str, Any]  # parameters: the survey area and how dead reckoning drifts
    spoilt: Counter = dataclasses.field(default_factory=Counter)  # messages to be refused, by input
    ping_topic: str = PINGS  # in the bag
    arguments: tuple[str, ...] = ()  # of the launch file: name:=value
    namespace: str = ""  # that the launch file is started in
    after: Callable[[Path], None] | None = None  # what is done to the bag's file at last

    @property
    def begin_s(self) -> float:
        return self.recorded[0].time.to_sec()

    def replace(self, **changes: Any) -> Survey:
        return dataclasses.replace(self, **changes)

    def of(self, topic: str) -> list[Recorded]:
        return [one for one in self.recorded if one.topic == topic]


def read_survey(bag: Path) -> Survey:
    """A simulated survey, whose overlay lies beside it."""
    with rosbag.Bag(str(bag)) as file:
        recorded = tuple(Recorded(*one) for one in file.read_messages())
    overlay = yaml.safe_load(bag.with_suffix(".survey.yaml").read_text(encoding="utf-8"))
    return Survey(recorded, overlay)


def write_survey(survey: Survey, bag: Path) -> None:
    """The bag and, beside it, the overlay."""
    with rosbag.Bag(str(bag), "w") as file:
        for topic, message, time in survey.recorded:
            header = _latched(topic) if topic.endswith(TF_STATIC) else None
            file.write(topic, message, time, connection_header=header)
    overlay = yaml.safe_dump(survey.overlay)
    bag.with_suffix(".survey.yaml").write_text(overlay, encoding="utf-8")
    if survey.after:
        survey.after(bag)


def _latched(topic: str) -> dict[str, str]:
    """As tf2's broadcaster publishes static transforms."""
    return {
        "topic": topic,
        "type": TFMessage._type,
        "md5sum": TFMessage._md5sum,
        "message_definition": TFMessage._full_text,
        "callerid": "/case",
        "latching": "1",
    }


# Steps. A change gets its own copy of the message; seconds count from the bag's first record.

Change = Callable[[Any, float], Any]


def each(survey: Survey, topic: str, change: Change) -> Survey:
    """change(message, seconds) returns a message, several, or None: none."""
    out: list[Recorded] = []
    begin_s = survey.begin_s
    for one in survey.recorded:
        if one.topic != topic:
            out.append(one)
            continue
        result = change(copy.deepcopy(one.message), one.time.to_sec() - begin_s)
        out += [one._replace(message=message) for message in _several(result)]
    return survey.replace(recorded=tuple(out))


def _several(result: Any) -> list[Any]:
    if result is None:
        return []
    return result if isinstance(result, list) else [result]


def spoil(
    survey: Survey, topic: str, chosen: Iterable[int], change: Callable[[Any], Any]
) -> Survey:
    """Change the chosen messages of a topic, of which none may be taken in any more."""
    indices, seen = set(chosen), -1

    def spoil_one(message: Any, _: float) -> Any:
        nonlocal seen
        seen += 1
        return change(message) if seen in indices else message

    return count_spoilt(each(survey, topic, spoil_one), topic, len(indices))


def count_spoilt(survey: Survey, topic: str, messages: int) -> Survey:
    return survey.replace(spoilt=survey.spoilt + Counter({INPUT_OF[topic]: messages}))


def insert(survey: Survey, more: Iterable[Recorded]) -> Survey:
    """More messages, by their record times; after others of the same time."""
    recorded = sorted([*survey.recorded, *more], key=lambda one: one.time)
    return survey.replace(recorded=tuple(recorded))


def drop(survey: Survey, dropped: Callable[[Recorded, float], bool]) -> Survey:
    """Without the messages for which dropped(recorded, seconds) is true."""
    begin_s = survey.begin_s
    kept = (one for one in survey.recorded if not dropped(one, one.time.to_sec() - begin_s))
    return survey.replace(recorded=tuple(kept))


def delay_records(survey: Survey, topics: Iterable[str], late_s: float) -> Survey:
    """Messages of the topics are recorded so much later; their stamps stay."""
    late, delayed = rospy.Duration(late_s), set(topics)
    moved = [
        one._replace(time=one.time + late) if one.topic in delayed else one
        for one in survey.recorded
    ]
    return survey.replace(recorded=tuple(sorted(moved, key=lambda one: one.time)))


def restamp(message: Any, seconds: float) -> Any:
    """The message with its stamp moved."""
    message.header.stamp += rospy.Duration(seconds)
    return message


def pause(survey: Survey, at_s: float, for_s: float) -> Survey:
    """Recording and vehicle stand still for a while; record times and stamps go on."""
    begin_s, gap = survey.begin_s, rospy.Duration(for_s)

    def moved(one: Recorded) -> Recorded:
        if one.time.to_sec() - begin_s <= at_s:
            return one
        message = copy.deepcopy(one.message)
        for stamped in getattr(message, "transforms", [message]):
            stamped.header.stamp += gap
        return one._replace(message=message, time=one.time + gap)

    return survey.replace(recorded=tuple(map(moved, survey.recorded)))
