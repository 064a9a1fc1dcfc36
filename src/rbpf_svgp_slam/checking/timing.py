"""Rates, gaps and clocks. Needs no ROS."""

from __future__ import annotations

import numpy as np

from rbpf_svgp_slam.checking.facts import Facts, Table
from rbpf_svgp_slam.checking.findings import OK, WARNING, Finding, plural

#: Of odometry: turns of some seconds must be seen.
LEAST_RATE_HZ = 2.0
#: A pause between pings of more than so many periods, and seconds, is told.
LONG_PAUSE_PERIODS, LONG_PAUSE_S = 20.0, 10.0
#: Between a stamp and the message's recording.
MOST_AHEAD_S, MOST_BEHIND_S = 1.0, 60.0


def timing_findings(facts: Facts) -> list[Finding]:
    """Of odometry and pings."""
    found = []
    if len(facts.odometry["stamp_s"]) > 1:
        found += [_odometry_rate(facts), _odometry_gaps(facts)]
        found += _clock("odometry", facts.odometry)
    if len(facts.placed["stamp_s"]) > 1:
        found.append(_ping_rate(facts))
    if len(facts.pings["stamp_s"]) > 1:
        found += _clock("ping", facts.pings)
    return found


def period_s(table: Table) -> float:
    """The median time from one message to the next."""
    return float(np.median(np.diff(table["stamp_s"])))


def _odometry_rate(facts: Facts) -> Finding:
    rate_hz = 1 / period_s(facts.odometry)
    expected = f"{LEAST_RATE_HZ:g} Hz or more"
    if rate_hz >= LEAST_RATE_HZ:
        return Finding("odometry_rate", OK, f"{rate_hz:.3g} Hz", expected)
    return Finding(
        "odometry_rate",
        WARNING,
        f"{rate_hz:.3g} Hz",
        expected,
        "the navigation publishes seldom, or the bag has been thinned",
        "record all odometry: between two messages the vehicle is taken to turn evenly",
    )


def _odometry_gaps(facts: Facts) -> Finding:
    bound_s = facts.parameters["odometry"]["gap_s"]
    stamps_s = facts.odometry["stamp_s"]
    steps_s = np.diff(stamps_s)
    gaps = np.flatnonzero(steps_s > bound_s)
    longest = int(np.argmax(steps_s))
    value = f"longest step {_seconds(steps_s[longest])}, at {stamps_s[longest] - stamps_s[0]:.0f} s"
    expected = f"at most {bound_s:g} s (odometry/gap_s)"
    if not len(gaps):
        return Finding("odometry_gaps", OK, value, expected)
    return Finding(
        "odometry_gaps",
        WARNING,
        f"{plural(len(gaps), 'gap')}; {value}",
        expected,
        "the recording was paused, the navigation restarted, or messages were lost",
        "if the vehicle was moved meanwhile, cut the bag there: rosbag filter",
    )


def _ping_rate(facts: Facts) -> Finding:
    usual_s = period_s(facts.placed)
    steps_s = np.diff(facts.placed["stamp_s"])
    longest_s = float(steps_s.max())
    value = f"{1 / usual_s:.3g} Hz" if usual_s > 0 else "several pings of one stamp"
    if longest_s <= max(LONG_PAUSE_S, LONG_PAUSE_PERIODS * usual_s):
        return Finding("ping_rate", OK, f"{value}, longest pause {_seconds(longest_s)}")
    return Finding(
        "ping_rate",
        WARNING,
        f"{value}, longest pause {_seconds(longest_s)}",
        f"pauses of at most {max(LONG_PAUSE_S, LONG_PAUSE_PERIODS * usual_s):.0f} s",
        "the sonar was off, lost the bottom, or messages were lost",
        "nothing, if it was off: dead reckoning goes on without pings",
    )


def _seconds(value: float) -> str:
    return f"{value:.0f} s" if value >= 10 else f"{value:.2f} s"


def _clock(name: str, table: Table) -> list[Finding]:
    """Stamps against the times of recording."""
    ahead_s = table["stamp_s"] - table["record_s"]
    usual_s, most_s = float(np.median(ahead_s)), float(ahead_s.max())
    expected = f"from {MOST_BEHIND_S:g} s before to {MOST_AHEAD_S:g} s after its recording"
    if -usual_s <= MOST_BEHIND_S and most_s <= MOST_AHEAD_S:
        value = f"stamps {max(0.0, -usual_s):.2f} s before their recording (median)"
        return [Finding(f"{name}_clock", OK, value, expected)]
    ahead = usual_s > 0
    return [
        Finding(
            f"{name}_clock",
            WARNING,
            f"stamps {abs(usual_s):.1f} s {'after' if ahead else 'before'} their recording "
            f"(median), at most {abs(most_s):.1f} s {'after' if most_s > 0 else 'before'}",
            expected,
            "the clock of the sensor or of the recording computer is not set, "
            "or the bag was recorded while another was played",
            "nothing, if all messages have the same clock; else set it, or correct the stamps",
        )
    ]
