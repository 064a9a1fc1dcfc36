"""Frames and mounts. Needs no ROS."""

from __future__ import annotations

import math

import numpy as np

from rbpf_svgp_slam.checking.facts import Facts, Mount, Topic
from rbpf_svgp_slam.checking.findings import ERROR, OK, WARNING, Finding


def frames_of_bag(odometry: Topic, frames: dict[str, str]) -> dict[str, str]:
    """What must be set of the group `frames`, so that the odometry is taken."""
    needed = {}
    if odometry.frame and odometry.frame not in {_plain(frames[name]) for name in ("odom", "map")}:
        needed["odom"] = odometry.frame
    if odometry.child_frame and odometry.child_frame != _plain(frames["base"]):
        needed["base"] = odometry.child_frame
    return needed


def _plain(frame: object) -> str:
    """As tf2 knows it: names of old began with a slash."""
    return str(frame).lstrip("/")


def odometry_frame_findings(
    odometry: Topic, frames: dict[str, str], config_is_given: bool
) -> list[Finding]:
    """Whether the odometry's frames are those of the parameters.

    Without a config the overlay will see to it, so that this is worth a warning only.
    """
    value = f"'{odometry.frame}' → '{odometry.child_frame}'"
    expected = f"'{frames['odom']}' → '{frames['base']}' (frames/odom, frames/base)"
    needed = frames_of_bag(odometry, frames)
    if not needed:
        if odometry.frame == _plain(frames["map"]):
            value += ": given in map, taken as it is"
        if not odometry.child_frame:
            value += f": no child_frame_id, taken for '{frames['base']}'"
        return [Finding("odometry_frames", OK, value)]
    settings = ", ".join(f"{name}: {frame}" for name, frame in needed.items())
    fix = f"frames: {{{settings}}}"
    if not config_is_given:
        fix += ", as the overlay has it"
    cause = "the navigation has other names for them"
    severity = ERROR if config_is_given else WARNING
    return [Finding("odometry_frames", severity, value, expected, cause, fix)]


def mount_findings(facts: Facts) -> list[Finding]:
    """Where each sonar is on the vehicle."""
    return [_mount_finding(mount, facts) for mount in facts.mounts]


def _mount_finding(mount: Mount, facts: Facts) -> Finding:
    base = facts.parameters["frames"]["base"]
    name = "mount"
    if mount.translation_m is None or mount.roll_pitch_yaw_rad is None:
        return _no_mount(mount, facts)
    x, y, z = mount.translation_m
    roll, pitch, yaw = (math.degrees(angle) + 0.0 for angle in mount.roll_pitch_yaw_rad)
    value = (
        f"'{mount.frame}' at x {x:.2f}, y {y:.2f}, z {z:.2f} m of '{base}', "
        f"turned by {roll:.1f}, {pitch:.1f}, {yaw:.1f}° (roll, pitch, yaw)"
    )
    longest_m = facts.parameters["plausibility"]["max_lever_arm_m"]
    if math.hypot(x, y, z) > longest_m:
        expected = f"within {longest_m:g} m (plausibility/max_lever_arm_m)"
        cause = "it is in millimetres, or the sensor is another vehicle's"
        return Finding(name, ERROR, value, expected, cause, "correct the transform, in metres")
    if mount.frame != base and not np.any([x, y, z, roll, pitch, yaw]):
        cause = "a placeholder: the mount was never entered"
        fix = "measure it: an error in roll tilts every swath, a lever arm shifts it"
        return Finding(name, WARNING, value, "the sonar's own place", cause, fix)
    return Finding(name, OK, value)


def _no_mount(mount: Mount, facts: Facts) -> Finding:
    frames = facts.parameters["frames"]
    base = frames["base"]
    links = ", ".join(f"{parent} → {child}" for parent, child in facts.links) or "none"
    value = f"no transform leads from '{base}' to '{mount.frame}'; there are: {links}"
    expected = f"{base} → {mount.frame} in /tf_static or, without change, in /tf"
    if mount.frame in (frames["odom"], frames["map"]):
        cause = "the beams have been placed by the navigation already"
        fix = "record the pings in the sonar's own frame: SLAM does the placing"
        return Finding("mount", ERROR, value, expected, cause, fix)
    cause = "/tf_static was not recorded, or the pings have another name for their frame"
    fix = "record /tf_static, or add the mount to the bag: docs/your_survey.md"
    return Finding("mount", ERROR, value, expected, cause, fix)
