"""How the odometry drifts, as far as the bag tells: the parameters motion/*. Needs no ROS."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rbpf_svgp_slam.checking.facts import Facts
from rbpf_svgp_slam.checking.findings import OK, WARNING, Finding
from rbpf_svgp_slam.checking.motion import relative_motion
from rbpf_svgp_slam.checking.timing import period_s

SURGE, SWAY, YAW = NAMES = ("surge_std_m", "sway_std_m", "yaw_std_rad")
#: What is believed, per sqrt(s).
PLAUSIBLE = {SURGE: (0.002, 1.0), SWAY: (0.002, 1.0), YAW: (2e-5, 0.05)}
#: Drift is looked at over so much time, in as many windows at least.
WINDOW_S = 5.0
FEWEST_WINDOWS = 20
#: Errors beyond so many robust standard deviations are jumps, of the ground truth for instance.
JUMP_SIGMA = 5.0
#: A config that is further off, by this factor, is warned of.
FAR_OFF = 4.0


@dataclass(frozen=True)
class MotionNoise:
    """Standard deviations per square root of a second, and how they were found."""

    values: dict[str, float]
    source: str
    is_measured: bool


def motion_noise(facts: Facts, defaults: dict[str, float]) -> MotionNoise:
    """From the twist's covariance, else against ground truth, else the defaults."""
    for measured, source in (
        (_from_covariance(facts), "from the odometry's own twist covariance"),
        (_from_ground_truth(facts), "from the odometry against ground truth"),
    ):
        if measured:
            return MotionNoise({**defaults, **measured}, source, is_measured=True)
    source = "the defaults: the bag does not tell how its dead reckoning drifts"
    return MotionNoise(dict(defaults), source, is_measured=False)


def noise_finding(noise: MotionNoise, given: dict[str, float]) -> Finding:
    """Whether the noise in use is like what the bag tells; given: in use."""
    value = ", ".join(f"{name} {given[name]:.2g}" for name in NAMES)
    if not noise.is_measured:
        cause = "no twist covariance and no ground truth"
        fix = "set motion/* as your dead reckoning drifts; see docs/tuning.md"
        return Finding("motion_noise", OK, f"{value}; nothing to compare with", "", cause, fix)
    found = ", ".join(f"{name} {noise.values[name]:.2g}" for name in NAMES)
    ratios = [given[name] / noise.values[name] for name in NAMES if noise.values[name] > 0]
    if all(1 / FAR_OFF <= ratio <= FAR_OFF for ratio in ratios):
        return Finding("motion_noise", OK, value, f"about {found}, {noise.source}")
    cause = "the defaults, or another vehicle's"
    fix = "motion: {" + ", ".join(f"{name}: {noise.values[name]:.2g}" for name in NAMES) + "}"
    return Finding("motion_noise", WARNING, value, f"{found}, {noise.source}", cause, fix)


def _plausible(values: dict[str, float]) -> dict[str, float]:
    """Those that can be; none, unless both of surge and yaw or sway are among them."""
    good = {
        name: float(value)
        for name, value in values.items()
        if PLAUSIBLE[name][0] <= value <= PLAUSIBLE[name][1]
    }
    return good if len(good) >= 2 else {}


def _from_covariance(facts: Facts) -> dict[str, float]:
    """White noise of std s per sqrt(s) has the variance s^2 / dt in each message's twist."""
    odometry = facts.odometry
    if len(odometry["stamp_s"]) < 2:
        return {}
    variances = (np.median(odometry[name]) for name in ("var_u", "var_v", "var_r"))
    dt = period_s(odometry)
    return _plausible(
        {name: np.sqrt(max(0.0, var) * dt) for name, var in zip(NAMES, variances) if var > 0}
    )


def _from_ground_truth(facts: Facts) -> dict[str, float]:
    """A random walk of s per sqrt(s) has the standard deviation s sqrt(T) after T seconds."""
    truth = {name: column for name, column in facts.ground_truth.items()}
    finite = np.isfinite(np.stack([truth[name] for name in ("stamp_s", "x_m", "y_m", "yaw_rad")]))
    order = np.flatnonzero(finite.all(axis=0))
    truth = {name: column[order] for name, column in truth.items()}
    if len(order) < 2 or len(facts.odometry["stamp_s"]) < 2:
        return {}
    begin_s = max(truth["stamp_s"][0], facts.odometry["stamp_s"][0])
    end_s = min(truth["stamp_s"][-1], facts.odometry["stamp_s"][-1])
    stamps_s = np.arange(begin_s, end_s, WINDOW_S)
    if len(stamps_s) <= FEWEST_WINDOWS:
        return {}
    errors = relative_motion(facts.odometry, stamps_s) - relative_motion(truth, stamps_s)
    return _plausible(dict(zip(NAMES, _spread(errors) / np.sqrt(WINDOW_S))))


def _spread(errors: np.ndarray) -> np.ndarray:
    """RMS of each row of errors [3, N], without jumps; constant drift is in it."""
    # 1.4826: from the median absolute deviation to a Gaussian's standard deviation
    robust = 1.4826 * np.median(np.abs(errors), axis=1, keepdims=True)
    usual = np.abs(errors) <= JUMP_SIGMA * robust
    return np.sqrt((errors**2 * usual).sum(axis=1) / np.maximum(usual.sum(axis=1), 1))
