"""The vehicle's motion, by its pose and its twist. Needs no ROS."""

from __future__ import annotations

import numpy as np

from rbpf_svgp_slam.checking.facts import Facts, Table
from rbpf_svgp_slam.checking.findings import ERROR, OK, WARNING, Finding, plural

_TWIST = ("u_mps", "v_mps", "w_mps", "p_radps", "q_radps", "r_radps")


def motion_findings(facts: Facts) -> list[Finding]:
    """Of the odometry."""
    if len(facts.odometry["stamp_s"]) < 2:
        return []
    return [_track(facts), *_twist(facts)]


def twist_is_empty(odometry: Table) -> bool:
    """Whether nothing but zeros is said of the velocities."""
    return not any(np.any(odometry[name]) for name in _TWIST)


def _track(facts: Facts) -> Finding:
    odometry = facts.odometry
    most_mps = facts.parameters["plausibility"]["max_speed_mps"]
    steps_s = np.diff(odometry["stamp_s"])
    steps_m = np.hypot(np.diff(odometry["x_m"]), np.diff(odometry["y_m"]))
    speed_mps = steps_m / steps_s
    value = (
        f"{steps_m.sum():.0f} m in {steps_s.sum():.0f} s, "
        f"{steps_m.sum() / steps_s.sum():.2f} m/s on average"
    )
    jumps = speed_mps > most_mps
    expected = f"at most {most_mps:g} m/s (plausibility/max_speed_mps)"
    if not steps_m.any():
        cause = "the pose is not filled in, or the vehicle lay still"
        return Finding("track", WARNING, value, "a vehicle that moves", cause)
    if not jumps.any():
        return Finding("track", OK, value, expected)
    value += f"; {plural(int(jumps.sum()), 'jump')}, the largest {steps_m[jumps].max():.1f} m"
    cause = "the pose is corrected by GPS or reset; or it is not in metres"
    if jumps.mean() > 0.5:
        cause = "the pose is not in metres: millimetres, or degrees of latitude"
    fix = "record odometry that does not jump: SLAM does the correcting"
    return Finding("track", WARNING, value, expected, cause, fix)


def _twist(facts: Facts) -> list[Finding]:
    velocity = facts.parameters["odometry"]["velocity"]
    if not twist_is_empty(facts.odometry):
        if any(noted.name == "twist_against_pose" for noted in facts.noted):
            return []
        return [Finding("twist", OK, f"agrees with the pose (odometry/velocity: {velocity})")]
    if velocity == "pose":
        return [Finding("twist", OK, "all zeros; the pose is used (odometry/velocity: pose)")]
    value = "all zeros" + ("" if velocity == "twist" else "; the pose is used instead")
    cause = "the navigation does not fill it in"
    fix = "odometry/velocity: pose, as the overlay has it; or fill in the twist"
    severity = ERROR if velocity == "twist" else WARNING
    return [Finding("twist", severity, value, "the body's velocities", cause, fix)]


def _pose_track(odometry: Table) -> np.ndarray:
    return np.stack([odometry["x_m"], odometry["y_m"], np.unwrap(odometry["yaw_rad"])])


def _relative(track: np.ndarray, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Motion [3, W] from begin to end, in the body frame at the beginning."""
    x, y, yaw = track[:, end] - track[:, begin]
    c, s = np.cos(track[2, begin]), np.sin(track[2, begin])
    return np.stack([c * x + s * y, -s * x + c * y, yaw])


def relative_motion(track: Table, stamps_s: np.ndarray) -> np.ndarray:
    """The pose's motion [3, N - 1] from each of some stamps to the next, in the body frame."""
    own = _pose_track(track)
    at = np.stack([np.interp(stamps_s, track["stamp_s"], row) for row in own])
    indices = np.arange(len(stamps_s))
    return _relative(at, indices[:-1], indices[1:])
