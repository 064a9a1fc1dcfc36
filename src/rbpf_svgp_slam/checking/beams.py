"""Beams of the pings: how many, NaN, ranges, outliers. Needs no ROS."""

from __future__ import annotations

import numpy as np

from rbpf_svgp_slam.checking.facts import Facts
from rbpf_svgp_slam.checking.findings import OK, WARNING, Finding
from rbpf_svgp_slam.checking.timing import period_s

FEWEST_BEAMS = 10
MOST_NOT_FINITE = MOST_OUTLIERS = 0.3
MOST_OUT_OF_RANGE = 0.05
SOUND_MPS = 1500.0
#: Pings that are under way at once, at most.
MOST_UNDER_WAY = 8.0


def beam_findings(facts: Facts) -> list[Finding]:
    """Of all pings together."""
    if not facts.pings["beams"].sum():
        return []
    found = [_beams_per_ping(facts), _not_finite(facts)]
    if facts.pings["finite"].sum():
        found += [_out_of_range(facts), _travel_time(facts)]
    if len(facts.placed["good"]):
        found.append(_outliers(facts))
    return found


def _beams_per_ping(facts: Facts) -> Finding:
    beams = float(np.median(facts.pings["beams"]))
    least, most = facts.pings["beams"].min(), facts.pings["beams"].max()
    value = f"{beams:.0f} (median), {least:.0f} to {most:.0f}"
    if beams >= FEWEST_BEAMS:
        return Finding("beams_per_ping", OK, value)
    cause = "an altimeter or a DVL, or clouds that hold one beam a message"
    fix = "put all beams of a ping into one message"
    expected = f"{FEWEST_BEAMS} or more"
    return Finding("beams_per_ping", WARNING, value, expected, cause, fix)


def _not_finite(facts: Facts) -> Finding:
    share = 1 - facts.pings["finite"].sum() / facts.pings["beams"].sum()
    value, expected = f"{100 * share:.1f} % of the beams", f"at most {100 * MOST_NOT_FINITE:.0f} %"
    if share <= MOST_NOT_FINITE:
        return Finding("not_finite", OK, value, expected)
    cause = "no bottom detected: too deep for the sonar, or bubbles; or clouds of a fixed size"
    return Finding("not_finite", WARNING, value, expected, cause, "nothing: they are left out")


def _out_of_range(facts: Facts) -> Finding:
    bounds = facts.parameters["pings"]
    least_m, most_m = bounds["min_range_m"], bounds["max_range_m"]
    pings = facts.pings
    share = 1 - pings["within"].sum() / pings["finite"].sum()
    value = (
        f"{np.nanmin(pings['min_range_m']):.1f} to {np.nanmax(pings['max_range_m']):.1f} m, "
        f"median {np.nanmedian(pings['median_range_m']):.1f} m; {100 * share:.1f} % refused"
    )
    expected = f"{least_m:g} to {most_m:g} m (pings/min_range_m, max_range_m)"
    if share <= MOST_OUT_OF_RANGE:
        return Finding("ranges", OK, value, expected)
    cause = "deeper water than these bounds allow, ranges in another unit, or zeros for no bottom"
    return Finding("ranges", WARNING, value, expected, cause, "set pings/max_range_m")


def _travel_time(facts: Facts) -> Finding:
    """Sound must have the time to come back."""
    range_m = float(np.nanmedian(facts.pings["median_range_m"]))
    travel_s = 2 * range_m / SOUND_MPS
    usual_s = abs(period_s(facts.pings)) if len(facts.pings["stamp_s"]) > 1 else travel_s
    value = f"{range_m:.1f} m there and back take {travel_s:.2g} s, a ping every {usual_s:.2g} s"
    if travel_s <= MOST_UNDER_WAY * usual_s or usual_s <= 0:
        return Finding("travel_time", OK, value)
    expected = f"at most {MOST_UNDER_WAY:g} pings under way at once"
    cause = "the beams are in millimetres or another unit"
    return Finding("travel_time", WARNING, value, expected, cause, "publish metres")


def _outliers(facts: Facts) -> Finding:
    # one ping of each stamp is taken
    stamps_s, first = np.unique(facts.pings["stamp_s"], return_index=True)
    within = facts.pings["within"][first][np.isin(stamps_s, facts.placed["stamp_s"])].sum()
    share = max(0.0, 1 - facts.placed["good"].sum() / max(1.0, within))
    value, expected = f"{100 * share:.1f} % of the beams", f"at most {100 * MOST_OUTLIERS:.0f} %"
    if share <= MOST_OUTLIERS:
        return Finding("outliers", OK, value, expected)
    cause = "false echoes; or beams that are not in the order of their angles"
    fix = "raise pings/outlier_threshold, or set pings/outlier_window: 0"
    return Finding("outliers", WARNING, value, expected, cause, fix)
