"""Findings of the filter's own checks, with what can be done about them. Needs no ROS."""

from __future__ import annotations

from rbpf_svgp_slam.checking.facts import Facts, Noted
from rbpf_svgp_slam.checking.findings import Finding
from rbpf_svgp_slam.checking.motion import twist_is_empty

#: What stands before the cause in a check's text.
_CAUSE = ". Likely cause: "
#: By name: what was expected, and the fix.
_ADVICE = {
    "twist_against_pose": (
        "both tell one motion",
        "odometry/velocity: pose, as the overlay has it; or correct the twist",
    ),
    "beams_above_vehicle": (
        "seabed below the vehicle: x forward, y left, z up",
        "turn the mount by 180° about x in /tf_static, or convert the messages",
    ),
    "seabed_above_sea": (
        "seabed below z = 0",
        "publish z negative under water; if z = 0 is another level than the sea's: nothing",
    ),
    "area_missed": ("beams in it", "take the overlay's survey_area"),
    "mount_changed": ("a mount that stays", "let one node publish it, once"),
}


def noted_findings(facts: Facts, area_is_given: bool) -> list[Finding]:
    """One for each that has no finding of its own; of the survey area only if it is a user's."""
    left_out = set() if area_is_given else {"area_missed"}
    if twist_is_empty(facts.odometry):
        left_out.add("twist_against_pose")
    return [_finding(noted) for noted in facts.noted if noted.name not in left_out]


def _finding(noted: Noted) -> Finding:
    value, _, cause = noted.text.partition(_CAUSE)
    expected, fix = _ADVICE.get(noted.name, ("", ""))
    return Finding(noted.name, noted.severity, value, expected, cause, fix)
