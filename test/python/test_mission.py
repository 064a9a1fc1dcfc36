"""Missions of the simulator: their lines, their scale and what they are made after."""

import dataclasses
import math

import numpy as np
import pytest

from rbpf_svgp_slam.simulation import SurveyError
from rbpf_svgp_slam.simulation.mission import MISSIONS, get_mission, plan_waypoints


@pytest.mark.parametrize("name", MISSIONS)
@pytest.mark.parametrize("scale", [0.25, 1.0])
def test_lines_stay_in_the_area_cross_each_other_and_return(name, scale):
    mission = get_mission(name, scale)
    waypoints_m = plan_waypoints(mission)
    area_m = np.array(mission.area_m)
    assert (waypoints_m >= mission.inset_m - 1e-9).all()
    assert (waypoints_m <= area_m - mission.inset_m + 1e-9).all()
    assert np.array_equal(waypoints_m[0], waypoints_m[-1])
    legs_m = np.diff(waypoints_m, axis=0)
    for axis in (0, 1):
        full = np.isclose(np.abs(legs_m[:, axis]), area_m[axis] - 2 * mission.inset_m)
        assert full.sum() >= 2, "lines from end to end in both directions"


def test_without_crossing_lines_there_are_the_lines_and_the_way_back():
    mission = dataclasses.replace(get_mission("lolo3"), crossing_spacing_m=math.inf)
    waypoints_m = plan_waypoints(mission)
    along_m = np.abs(np.diff(waypoints_m, axis=0))
    full_m = mission.area_m[0] - 2 * mission.inset_m
    lines = np.isclose(along_m[:, 0], full_m) & (along_m[:, 1] == 0)
    assert lines.sum() == 7 and np.array_equal(waypoints_m[0], waypoints_m[-1])
    assert (along_m[:-1, 1][~lines[:-1]] < 1.01 * mission.line_spacing_m).all(), "none across"


@pytest.mark.parametrize("name", MISSIONS)
def test_scale_shortens_in_proportion(name):
    def track_m(scale):
        waypoints_m = plan_waypoints(get_mission(name, scale))
        return np.linalg.norm(np.diff(waypoints_m, axis=0), axis=1).sum()

    # Whole numbers of lines, and at least three crossings, make it rough.
    assert 0.2 < track_m(0.25) / track_m(1.0) < 0.4


def test_full_size_missions_match_the_numbers_they_are_made_after():
    assert MISSIONS["lolo3"].area_m == (250.0, 150.0)
    for name, beams, duration_s in (
        ("hugin1", 8.08e6, 4.45 * 3600),
        ("lolo2", 12.4e6, 2.25 * 3600),
    ):
        mission = MISSIONS[name]
        legs_m = np.diff(plan_waypoints(mission), axis=0)
        nominal_s = np.linalg.norm(legs_m, axis=1).sum() / mission.speed_mps
        # Turns are cut, which saves up to a percent of the way.
        assert nominal_s == pytest.approx(duration_s, rel=0.015)
        assert mission.beams * mission.ping_rate_hz * nominal_s == pytest.approx(beams, rel=0.015)


@pytest.mark.parametrize("name, scale", [("lolo9", 1.0), ("demo", 0.0), ("demo", math.nan)])
def test_unknown_missions_and_scales_are_refused(name, scale):
    with pytest.raises(SurveyError, match=r"(mission|scale) is .*, expected"):
        get_mission(name, scale)
    with pytest.raises(SurveyError, match="at least two turn radii"):
        get_mission("demo", 0.001)
