"""The vehicle's motion: speed, and the twist against the pose. Needs no ROS."""

from __future__ import annotations

import numpy as np

from rbpf_svgp_slam.checking.facts import Facts, Table
from rbpf_svgp_slam.checking.findings import ERROR, OK, WARNING, Finding
from rbpf_svgp_slam.checking.timing import period_s

MOST_SPEED_MPS = 20.0
WINDOW_S = 10.0
#: A window tells something where the vehicle moved by so much.
MOVED_M, TURNED_RAD = 2.0, 0.2
#: Twist and pose disagree beyond this, and beyond this share of the motion.
APART_M, APART_RAD, APART_SHARE = 1.0, 0.1, 0.3
_TWIST = ("u_mps", "v_mps", "w_mps", "p_radps", "q_radps", "r_radps")


def motion_findings(facts: Facts) -> list[Finding]:
    """Of the odometry."""
    if len(facts.odometry["stamp_s"]) < 2:
        return []
    return [*_track(facts.odometry), _twist(facts)]


def twist_is_empty(odometry: Table) -> bool:
    """Whether nothing but zeros is said of the velocities."""
    return not any(np.any(odometry[name]) for name in _TWIST)


def _track(odometry: Table) -> list[Finding]:
    steps_s = np.diff(odometry["stamp_s"])
    steps_m = np.hypot(np.diff(odometry["x_m"]), np.diff(odometry["y_m"]))
    speed_mps = steps_m / steps_s
    value = (
        f"{steps_m.sum():.0f} m in {steps_s.sum():.0f} s, "
        f"{steps_m.sum() / steps_s.sum():.2f} m/s on average"
    )
    jumps = speed_mps > MOST_SPEED_MPS
    expected = f"at most {MOST_SPEED_MPS:g} m/s"
    if not steps_m.any():
        cause = "the pose is not filled in, or the vehicle lay still"
        return [Finding("track", WARNING, value, "a vehicle that moves", cause)]
    if not jumps.any():
        return [Finding("track", OK, value, expected)]
    value += f"; {jumps.sum()} jumps, the largest {steps_m[jumps].max():.1f} m"
    cause = "the pose is corrected by GPS or reset; or it is not in metres"
    if jumps.mean() > 0.5:
        cause = "the pose is not in metres: millimetres, or degrees of latitude"
    fix = "record odometry that does not jump: SLAM does the correcting"
    return [Finding("track", WARNING, value, expected, cause, fix)]


def _twist(facts: Facts) -> Finding:
    velocity = facts.parameters["odometry"].get("velocity", "twist")
    if twist_is_empty(facts.odometry):
        fix = "odometry/velocity: pose, as the overlay has it; or fill in the twist"
        cause = "the navigation does not fill it in"
        severity = ERROR if velocity == "twist" else WARNING
        return Finding("twist", severity, "all zeros", "the body's velocities", cause, fix)
    moved, disagree, figures = _windows(facts.odometry)
    value = f"disagrees with the pose in {disagree} of {moved} windows of {WINDOW_S:g} s{figures}"
    expected = f"within {APART_M:g} m and {APART_RAD:g} rad, or {100 * APART_SHARE:.0f} %"
    if disagree <= moved / 2:
        return Finding("twist", OK, value, expected)
    cause = _cause(facts.odometry)
    fix = "odometry/velocity: pose, or correct the twist: body frame, m/s and rad/s"
    severity = WARNING if velocity == "pose" else ERROR
    return Finding("twist_against_pose", severity, value, expected, cause, fix)


def twist_disagrees(odometry: Table) -> bool:
    """Whether the twist is another motion than the pose's."""
    moved, disagree, _ = _windows(odometry)
    return disagree > moved / 2


def _windows(odometry: Table) -> tuple[int, int, str]:
    """How many windows tell something, in how many the two disagree; figures of the first."""
    begin, end = _window_bounds(odometry["stamp_s"])
    by_twist, by_pose = _integrated(odometry), _pose_track(odometry)
    a, b = (_relative(track, begin, end) for track in (by_twist, by_pose))
    moved_m = np.maximum(np.hypot(a[0], a[1]), np.hypot(b[0], b[1]))
    turned = np.maximum(np.abs(a[2]), np.abs(b[2]))
    tell = (moved_m > MOVED_M) | (turned > TURNED_RAD)
    apart = np.hypot(a[0] - b[0], a[1] - b[1]) > np.maximum(APART_M, APART_SHARE * moved_m)
    apart |= np.abs(a[2] - b[2]) > np.maximum(APART_RAD, APART_SHARE * turned)
    disagree = np.flatnonzero(tell & apart)
    figures = ""
    if len(disagree):
        k = disagree[0]
        figures = (
            f"; in the first the twist sails {np.hypot(a[0][k], a[1][k]):.1f} m and turns by "
            f"{a[2][k]:.2f} rad, the pose {np.hypot(b[0][k], b[1][k]):.1f} m and {b[2][k]:.2f} rad"
        )
    return int(tell.sum()), len(disagree), figures


def _window_bounds(stamps_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Indices of first and last messages of windows without a gap."""
    window = np.floor((stamps_s - stamps_s[0]) / WINDOW_S)
    begin = np.flatnonzero(np.diff(window, prepend=-1.0))
    begin, end = begin[:-1], begin[1:]
    lasts_s = stamps_s[end] - stamps_s[begin]
    whole = (lasts_s > 0) & (lasts_s < 2 * WINDOW_S)
    return begin[whole], end[whole]


def _pose_track(odometry: Table) -> np.ndarray:
    return np.stack([odometry["x_m"], odometry["y_m"], np.unwrap(odometry["yaw_rad"])])


def _integrated(odometry: Table) -> np.ndarray:
    """The track [3, N] that the twist tells, from the pose's start."""
    steps_s = np.diff(odometry["stamp_s"])

    def steps(name: str) -> np.ndarray:
        return steps_s * (odometry[name][1:] + odometry[name][:-1]) / 2

    def summed(start: float, increments: np.ndarray) -> np.ndarray:
        return start + np.concatenate([[0.0], np.cumsum(increments)])

    yaw = summed(odometry["yaw_rad"][0], steps("r_radps"))
    halfway = (yaw[1:] + yaw[:-1]) / 2
    forward, left = steps("u_mps"), steps("v_mps")
    x = summed(odometry["x_m"][0], forward * np.cos(halfway) - left * np.sin(halfway))
    y = summed(odometry["y_m"][0], forward * np.sin(halfway) + left * np.cos(halfway))
    return np.stack([x, y, yaw])


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


def _cause(odometry: Table) -> str:
    """By the ratios of rates and speeds."""
    yaw = np.unwrap(odometry["yaw_rad"])
    pose_rate = np.abs(np.diff(yaw) / np.diff(odometry["stamp_s"])).mean()
    rate = np.abs(odometry["r_radps"]).mean() / max(pose_rate, 1e-9)
    if rate < 0.05:
        return "the twist has no yaw rate"
    if 30 < rate < 90:
        return "the twist's rates are in degrees"
    turning = np.diff(yaw) * odometry["r_radps"][1:]
    if turning.sum() < -0.5 * np.abs(turning).sum():
        return "the sign of the yaw rate: z down instead of up"
    steps_m = np.hypot(np.diff(odometry["x_m"]), np.diff(odometry["y_m"]))
    speed_mps = steps_m.sum() / (period_s(odometry) * len(steps_m))
    ratio = np.hypot(odometry["u_mps"], odometry["v_mps"]).mean() / max(speed_mps, 1e-9)
    if 1.7 < ratio < 2.2:
        return "the twist's speed is in knots"
    if 0.8 < ratio < 1.2:
        return "the linear twist is in the odometry's frame, not in the body's"
    return "the twist and the pose come from different sources or units"
