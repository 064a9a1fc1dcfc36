"""Depths, the swath, its overlap, and the survey area. Needs no ROS."""

from __future__ import annotations

from typing import Any

import numpy as np

from rbpf_svgp_slam.checking.facts import Facts
from rbpf_svgp_slam.checking.findings import OK, WARNING, Finding
from rbpf_svgp_slam.survey_area.polygon import inside

#: Seabed counts as seen before if so much time lies between.
LATER_S = 60.0
LEAST_OVERLAP = 0.1
LEAST_INSIDE = 0.5


def geometry_findings(facts: Facts, area: list[Any] | None) -> list[Finding]:
    """Of the sampled beams; area: the survey area, where it is given."""
    if not len(facts.beams["z_m"]):
        return []
    found = [_depths(facts), _swath(facts), _overlap(facts)]
    missed = any(noted.name == "area_missed" for noted in facts.noted)
    return found + ([_area(facts, area)] if area and not missed else [])


def _depths(facts: Facts) -> Finding:
    vehicle_z_m = facts.placed["vehicle_z_m"][facts.beams["ping"].astype(int)]
    z_m = facts.beams["z_m"]
    value = (
        f"seabed at z {np.median(z_m):.1f} m (median), "
        f"vehicle at z {vehicle_z_m.min():.1f} to {vehicle_z_m.max():.1f} m"
    )
    return Finding("depth", OK, value)


def _swath(facts: Facts) -> Finding:
    forward_m = np.nanmedian(facts.placed["max_forward_m"] - facts.placed["min_forward_m"])
    across_m = np.nanmedian(facts.placed["max_left_m"] - facts.placed["min_left_m"])
    left_m = np.nanmedian(facts.placed["max_left_m"] + facts.placed["min_left_m"]) / 2
    value = (
        f"{across_m:.1f} m across, {forward_m:.1f} m along the vehicle, middle {left_m:.1f} m left"
    )
    if across_m >= forward_m:
        return Finding("swath", OK, value)
    cause = "the mount's yaw is wrong by 90°, or the sonar looks forward"
    fix = "check the mount in /tf_static: the fan lies across base_link's x"
    return Finding("swath", WARNING, value, "wider across than along", cause, fix)


def _overlap(facts: Facts) -> Finding:
    share, apart_m, cell_m = overlap(facts)
    value = f"{100 * share:.0f} % of the beams lie over seabed seen {LATER_S:.0f} s earlier or more"
    if share > 0:
        value += f"; depths there {apart_m:.2f} m apart (median, cells of {cell_m:.1f} m)"
    expected = f"{100 * LEAST_OVERLAP:.0f} % or more"
    if share >= LEAST_OVERLAP:
        return Finding("overlap", OK, value, expected)
    cause = "survey lines further apart than the swath is wide, no crossing lines, or one line only"
    fix = "plan crossing lines: without overlap SLAM cannot correct the drift"
    return Finding("overlap", WARNING, value, expected, cause, fix)


def overlap(facts: Facts) -> tuple[float, float, float]:
    """Share of beams over seabed seen LATER_S earlier; the median difference of depths; the cells.

    Cells are as fine as the sampled pings let them be.
    """
    beams, stamps_s = facts.beams, facts.beam_stamps()
    at = np.column_stack([beams["x_m"], beams["y_m"]])
    used = np.isfinite(facts.placed["vehicle_x_m"])
    track = np.column_stack([facts.placed["vehicle_x_m"], facts.placed["vehicle_y_m"]])[used]
    steps_m = np.linalg.norm(np.diff(track, axis=0), axis=1) if len(track) > 1 else np.zeros(1)
    across_m = np.linalg.norm(np.diff(at, axis=0), axis=1)[np.diff(beams["ping"]) == 0]
    cell_m = max(1.0, 1.5 * np.median(steps_m), 1.5 * np.median(across_m) if len(across_m) else 0)
    _, cell = np.unique(np.floor((at - at.min(axis=0)) / cell_m), axis=0, return_inverse=True)
    cell = cell.ravel()
    first_s = np.full(cell.max() + 1, np.inf)
    np.minimum.at(first_s, cell, stamps_s)
    later = stamps_s - first_s[cell] >= LATER_S
    apart_m = _differences(beams["z_m"], cell, later)
    return float(later.mean()), float(np.median(apart_m)) if len(apart_m) else 0.0, float(cell_m)


def _differences(z_m: np.ndarray, cell: np.ndarray, later: np.ndarray) -> np.ndarray:
    """By how much the mean depths of earlier and later beams differ, of cells that have both."""
    means = []
    both = np.ones(cell.max() + 1, dtype=bool)
    for part in (later, ~later):
        beams = np.bincount(cell[part], minlength=len(both))
        both &= beams > 0
        means.append(np.bincount(cell[part], z_m[part], len(both)) / np.maximum(beams, 1))
    return np.abs(means[0] - means[1])[both]


def _area(facts: Facts, area: list[Any]) -> Finding:
    at = np.column_stack([facts.beams["x_m"], facts.beams["y_m"]])
    share = float(inside(at, np.asarray(area, dtype=float)).mean())
    value = f"{100 * share:.0f} % of the beams lie in it: beams {_box(at)}; area {_box(area)}"
    expected = f"{100 * LEAST_INSIDE:.0f} % or more"
    if share >= LEAST_INSIDE:
        return Finding("survey_area", OK, value, expected)
    cause = "the area is smaller than what was surveyed, or another survey's"
    fix = "take the overlay's, unless the rest shall not be mapped"
    return Finding("survey_area", WARNING, value, expected, cause, fix)


def _box(points: Any) -> str:
    low, high = np.min(points, axis=0), np.max(points, axis=0)
    return f"x {low[0]:.0f} to {high[0]:.0f}, y {low[1]:.0f} to {high[1]:.0f} m"
