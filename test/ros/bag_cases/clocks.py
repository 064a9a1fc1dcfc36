"""Stamps of other times, in another order, or twice."""

from __future__ import annotations

import copy
from typing import Any, Callable

import rospy

from bag_cases.expected import RIGHT, Case, refused, stops
from bag_cases.survey import (
    INPUT_OF,
    ODOMETRY,
    PINGS,
    TRUTH,
    Survey,
    count_spoilt,
    delay_records,
    drop,
    each,
    insert,
    restamp,
    spoil,
)

HOUR_S = 3600.0
#: ros::Time of C++ and genpy hold 32 bits of seconds without sign; signed arithmetic fails here.
BEYOND_SIGNED = rospy.Time(2**31 + 5)


def one_odometry_moved(seconds: float) -> Callable[[Survey], Survey]:
    return lambda survey: spoil(survey, ODOMETRY, [900], lambda m: restamp(m, seconds))


def one_of_each_moved(seconds: float) -> Callable[[Survey], Survey]:
    def make(survey: Survey) -> Survey:
        survey = one_odometry_moved(seconds)(survey)
        return spoil(survey, PINGS, [150], lambda m: restamp(m, seconds))

    return make


def one_of_each_beyond_2038(survey: Survey) -> Survey:
    def far(message: Any) -> Any:
        message.header.stamp = BEYOND_SIGNED
        return message

    return spoil(spoil(survey, ODOMETRY, [900], far), PINGS, [150], far)


def some_without_stamp(survey: Survey) -> Survey:
    def unstamped(message: Any) -> Any:
        message.header.stamp = rospy.Time(0)
        return message

    survey = spoil(survey, ODOMETRY, range(700, 710), unstamped)
    return spoil(survey, PINGS, range(200, 205), unstamped)


def set_late(survey: Survey, before_s: float = 20.0) -> Survey:
    """Stamps count from 1970 until the clock is set; the recorder's own clock is right."""
    for topic in (ODOMETRY, PINGS, TRUTH):

        def of_1970(message: Any, seconds: float) -> Any:
            if seconds < before_s:
                message.header.stamp = rospy.Time.from_sec(5.0 + seconds)
            return message

        early = sum(o.time.to_sec() - survey.begin_s < before_s for o in survey.of(topic))
        survey = each(survey, topic, of_1970)
        if topic in INPUT_OF:
            survey = count_spoilt(survey, topic, early)
    return survey


def early_pings_ahead(survey: Survey, pings: int = 200) -> Survey:
    """Pings an hour ahead of their time, before and among the first valid ones."""
    first = survey.of(PINGS)[0]
    more = []
    for k in range(pings):
        message = restamp(copy.deepcopy(first.message), HOUR_S + 0.05 * k)
        more.append(first._replace(message=message, time=first.time + rospy.Duration(0.05 * k)))
    return count_spoilt(insert(survey, more), PINGS, pings)


def all_pings_moved(seconds: float) -> Callable[[Survey], Survey]:
    def make(survey: Survey) -> Survey:
        pings = range(len(survey.of(PINGS)))
        return spoil(survey, PINGS, pings, lambda m: restamp(m, seconds))

    return make


def played_again(survey: Survey, again_s: float = 30.0) -> Survey:
    """A simulator that loops: the first half minute comes once more, at the end."""
    length_s = survey.recorded[-1].time.to_sec() - survey.begin_s + 1.0
    more = [
        one._replace(time=one.time + rospy.Duration(length_s))
        for one in survey.recorded
        if one.topic in INPUT_OF and one.time.to_sec() - survey.begin_s < again_s
    ]
    for topic in INPUT_OF:
        survey = count_spoilt(survey, topic, sum(one.topic == topic for one in more))
    return insert(survey, more)


def all_twice(topic: str) -> Callable[[Survey], Survey]:
    def make(survey: Survey) -> Survey:
        messages = len(survey.of(topic))
        return count_spoilt(each(survey, topic, lambda m, _: [m, m]), topic, messages)

    return make


def one_ping_twenty_times(survey: Survey) -> Survey:
    ping = survey.of(PINGS)[100]
    return count_spoilt(insert(survey, [ping] * 19), PINGS, 19)


def records_of_another_year(survey: Survey) -> Survey:
    """A bag written anew by a tool: its record times have nothing to do with the stamps."""
    moved = [one._replace(time=one.time + rospy.Duration(9e7)) for one in survey.recorded]
    return survey.replace(recorded=tuple(moved))


def odometry_after_pings(survey: Survey) -> Survey:
    """Each odometry message is recorded 3 s late, so that pings wait for it."""
    return delay_records(survey, [ODOMETRY], 3.0)


def pings_late(survey: Survey) -> Survey:
    """Each ping is recorded 15 s late, as after a core has stood still."""
    return delay_records(survey, [PINGS], 15.0)


def every_second_ping(survey: Survey) -> Survey:
    """As rosbag filter leaves a bag: header.seq has gaps, and nothing has been lost."""
    seqs = {id(one.message): k for k, one in enumerate(survey.of(PINGS))}
    return drop(survey, lambda one, _: one.topic == PINGS and seqs[id(one.message)] % 2 == 1)


AHEAD, BEHIND = "pings/clock_ahead", "pings/clock_behind"
TWICE = "odometry/duplicate_stamp", "pings/duplicate_stamp"
CASES = [
    Case(
        "hour_ahead_once",
        "clocks",
        "one odometry message an hour ahead",
        one_odometry_moved(HOUR_S),
        refused("odometry/clock_ahead"),
    ),
    Case(
        "ten_minutes_ahead_once",
        "clocks",
        "one odometry message and one ping ten minutes ahead",
        one_of_each_moved(600.0),
        refused("odometry/clock_ahead", AHEAD),
    ),
    Case(
        "beyond_2038_once",
        "clocks",
        "one odometry message and one ping beyond 2³¹ s",
        one_of_each_beyond_2038,
        refused("odometry/clock_ahead", AHEAD),
    ),
    Case(
        "no_stamp",
        "clocks",
        "10 odometry messages and 5 pings with stamp zero",
        some_without_stamp,
        refused("odometry/no_stamp", "pings/no_stamp"),
    ),
    Case(
        "clock_set_late",
        "clocks",
        "20 s of stamps from 1970 on",
        set_late,
        refused("odometry/clock_behind", BEHIND),
    ),
    Case(
        "200_pings_ahead",
        "clocks",
        "200 pings an hour ahead before the valid ones",
        early_pings_ahead,
        refused(AHEAD),
    ),
    Case(
        "sonar_hour_ahead",
        "clocks",
        "all pings an hour ahead",
        all_pings_moved(HOUR_S),
        stops(AHEAD, "sonar's clock"),
    ),
    Case(
        "sonar_day_behind",
        "clocks",
        "all pings a day behind",
        all_pings_moved(-24 * HOUR_S),
        stops(BEHIND, "sonar's clock"),
    ),
    Case(
        "records_of_another_year",
        "clocks",
        "a bag written anew years later",
        records_of_another_year,
        RIGHT,
    ),
    Case(
        "odometry_3_s_late", "clocks", "odometry is recorded 3 s late", odometry_after_pings, RIGHT
    ),
    Case(
        "pings_15_s_late",
        "clocks",
        "pings are recorded 15 s late",
        pings_late,
        RIGHT,
    ),
    Case(
        "played_again",
        "order",
        "the first 30 s come again at the end",
        played_again,
        refused(*TWICE),
        refused("odometry/out_of_order", "pings/duplicate_stamp", "pings/no_odometry"),
    ),
    Case(
        "odometry_twice",
        "order",
        "each odometry message twice",
        all_twice(ODOMETRY),
        refused("odometry/duplicate_stamp"),
    ),
    Case(
        "pings_twice",
        "order",
        "each ping twice",
        all_twice(PINGS),
        refused("pings/duplicate_stamp"),
    ),
    Case(
        "ping_20_times",
        "order",
        "one ping 20 times",
        one_ping_twenty_times,
        refused("pings/duplicate_stamp"),
    ),
    Case("every_second_ping", "order", "header.seq with gaps", every_second_ping, RIGHT),
]
