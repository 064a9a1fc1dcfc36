"""Recordings that pause, lack something, or are broken."""

from __future__ import annotations

from pathlib import Path
from typing import Callable

from bag_cases.expected import RIGHT, Case, refused, stops
from bag_cases.survey import ODOMETRY, PINGS, Survey, count_spoilt, drop, pause

PAUSE_S = 60.0


def pause_in_recording(survey: Survey) -> Survey:
    return pause(survey, at_s=40.0, for_s=PAUSE_S)


def hour_between_dives(survey: Survey) -> Survey:
    return pause(survey, at_s=50.0, for_s=3600.0)


def pause_of_pings(survey: Survey) -> Survey:
    return drop(survey, lambda one, s: one.topic == PINGS and 25.0 < s < 25.0 + PAUSE_S)


def pause_of_odometry(for_s: float) -> Callable[[Survey], Survey]:
    """Navigation is silent for a while, and the vehicle sails on."""

    def make(survey: Survey) -> Survey:
        return drop(survey, lambda one, s: one.topic == ODOMETRY and 30.0 < s < 30.0 + for_s)

    return make


def long_pause_of_odometry(survey: Survey) -> Survey:
    """So long that nobody knows where the vehicle was in between."""
    survey = pause_of_odometry(20.0)(survey)
    stamps_s = [one.message.header.stamp.to_sec() - survey.begin_s for one in survey.of(PINGS)]
    in_gap = sum(30.0 < stamp_s < 50.0 for stamp_s in stamps_s)
    return count_spoilt(survey, PINGS, in_gap)


def odometry_ends_early(survey: Survey, at_s: float = 70.0) -> Survey:
    survey = drop(survey, lambda one, s: one.topic == ODOMETRY and s > at_s)
    later = sum(one.time.to_sec() - survey.begin_s > at_s for one in survey.of(PINGS))
    return count_spoilt(survey, PINGS, later)


def without_pings(survey: Survey) -> Survey:
    return drop(survey, lambda one, _: one.topic == PINGS)


def without_odometry(survey: Survey) -> Survey:
    return drop(survey, lambda one, _: one.topic == ODOMETRY)


def empty(survey: Survey) -> Survey:
    return survey.replace(recorded=())


def cut_off(survey: Survey) -> Survey:
    """The disk was full, or the power gone: the index at the file's end is missing."""

    def cut(bag: Path) -> None:
        content = bag.read_bytes()
        bag.write_bytes(content[: 2 * len(content) // 3])

    return survey.replace(after=cut)


def no_bag_at_all(survey: Survey) -> Survey:
    """A text file of that name."""
    return survey.replace(after=lambda bag: bag.write_text("no bag\n", encoding="utf-8"))


def missing(survey: Survey) -> Survey:
    return survey.replace(after=lambda bag: bag.unlink())


CASES = [
    Case("pause_in_recording", "pauses", "60 s without any message", pause_in_recording, RIGHT),
    Case(
        "hour_between_dives",
        "pauses",
        "an hour without any message",
        hour_between_dives,
        RIGHT,
        not_live="takes minutes",
    ),
    Case("pause_of_pings", "pauses", "60 s without pings", pause_of_pings, RIGHT),
    Case(
        "pause_of_odometry",
        "pauses",
        "5 s without odometry, under way",
        pause_of_odometry(5.0),
        RIGHT,
    ),
    Case(
        "long_pause_of_odometry",
        "pauses",
        "20 s without odometry, under way",
        long_pause_of_odometry,
        refused("pings/in_gap"),
    ),
    Case(
        "odometry_ends_early",
        "pauses",
        "no odometry after 70 s",
        odometry_ends_early,
        refused("pings/no_odometry"),
    ),
    Case(
        "without_pings",
        "broken bags",
        "no ping topic",
        without_pings,
        stops("/mbes/pings", "/odom"),
    ),
    Case(
        "without_odometry",
        "broken bags",
        "no odometry topic",
        without_odometry,
        stops("/odom", "/mbes/pings"),
    ),
    Case("empty_bag", "broken bags", "no message at all", empty, stops("no (message|topic)")),
    Case(
        "cut_off_bag", "broken bags", "the file's end is missing", cut_off, stops("rosbag reindex")
    ),
    Case("no_bag_at_all", "broken bags", "a text file", no_bag_at_all, stops(r"\.bag")),
    Case("missing_bag", "broken bags", "no such file", missing, stops(r"\.bag")),
]
