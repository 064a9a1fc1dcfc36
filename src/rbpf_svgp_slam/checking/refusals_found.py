"""Messages that SLAM would refuse. Needs no ROS."""

from __future__ import annotations

from rbpf_svgp_slam.checking.facts import Facts, Topic
from rbpf_svgp_slam.checking.findings import ERROR, WARNING, Finding

#: By reason: likely cause and fix.
_EXPLANATIONS = {
    "wrong_type": ("messages of several types on one topic", "record them on topics of their own"),
    "malformed": ("the driver fills the message in another way", "see the first example"),
    "no_stamp": ("the driver leaves header.stamp empty", "let it stamp its messages"),
    "wrong_frame": (
        "two sources publish on one topic, or the names changed during the recording",
        "set frames/odom and frames/base; keep other sources off the topic",
    ),
    "not_finite": ("the navigation says NaN while it knows nothing", "nothing, if it is rare"),
    "duplicate_stamp": ("published or recorded twice", "nothing: one of each is taken"),
    "out_of_order": ("a clock was set back, or bags were merged", "correct the stamps"),
    "clock_ahead": ("the sensor's clock is not set", "set it, or correct the stamps"),
    "clock_behind": ("the sensor's clock was not set yet", "set it, or correct the stamps"),
    "implausible_twist": (
        "units: rates in degrees or speed in knots, or spikes",
        "correct the units; odometry/velocity: pose does without the twist",
    ),
    "implausible_pose": ("the pose jumps, or is not in metres", "see the first example"),
    "no_beams": (
        "the sonar had no bottom, or ranges lie outside of pings/min_range_m .. max_range_m",
        "nothing, before the dive; else widen these bounds",
    ),
    "no_odometry": (
        "pings before the first or after the last odometry, or from another clock",
        "nothing, if few; else see the findings ping_clock and odometry_clock",
    ),
    "in_gap": ("pings while the odometry was missing", "see the finding odometry_gaps"),
}


def refusal_findings(facts: Facts) -> list[Finding]:
    """One for each reason; an error where nothing is left."""
    kinds = {
        "odometry": (facts.chosen.odometry, len(facts.odometry["stamp_s"])),
        "pings": (facts.chosen.pings, len(facts.placed["stamp_s"])),
    }
    found = []
    for name, refused in facts.refused.items():
        if name in _told_elsewhere(facts):
            continue
        kind, reason = name.split("/")
        topic, accepted = kinds[kind]
        cause, fix = _EXPLANATIONS.get(reason, ("", ""))
        found.append(
            Finding(
                f"refused_{kind}_{reason}",
                WARNING if accepted else ERROR,
                f"{refused.messages} of {_messages(topic)} messages; the first: {refused.first}",
                "none" if accepted else "some that are taken",
                cause,
                fix,
            )
        )
    return found


def _told_elsewhere(facts: Facts) -> set[str]:
    """What follows from something that has a finding of its own."""
    told = {"pings/no_mount", "pings/implausible_mount"}  # mount
    if not len(facts.odometry["stamp_s"]):
        told |= {"pings/no_odometry", "pings/queue_full", "pings/survey_over"}
    return told


def _messages(topic: Topic | None) -> int:
    return topic.messages if topic else 0
