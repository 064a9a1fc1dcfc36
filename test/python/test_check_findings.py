"""What is said of a bag: every finding on facts in which one thing is wrong."""

import numpy as np
import pytest
from made_up_facts import AREA, ODOMETRY, PINGS, START_S, TRUTH, make_facts, topic

from rbpf_svgp_slam.checking.check_bag import judge
from rbpf_svgp_slam.checking.facts import ChosenTopics, Mount, Noted, Refused
from rbpf_svgp_slam.checking.findings import ERROR, OK, WARNING, Finding, count, worst_first
from rbpf_svgp_slam.checking.frames import frames_of_bag, odometry_frame_findings
from rbpf_svgp_slam.checking.geometry import overlap
from rbpf_svgp_slam.checking.terminal import findings_text, summary
from rbpf_svgp_slam.checking.topic_choice import choose_topics

MOTION = {"surge_std_m": 0.06, "sway_std_m": 0.03, "yaw_std_rad": 0.002}


@pytest.fixture
def facts():
    return make_facts()


def findings(facts, area=AREA, **motion):
    tree = {**facts.parameters, "survey_area": area, "motion": {**MOTION, **motion}}
    found = judge(facts, tree)
    names = [finding.name for finding in found]
    assert len(set(names)) == len(names)
    return {finding.name: finding for finding in found}


def bad(facts, **options):
    """Severity, value and cause of those that are not ok, by name."""
    return {
        name: (finding.severity, f"{finding.value}; {finding.cause}")
        for name, finding in findings(facts, **options).items()
        if finding.severity != OK
    }


def only(facts, name, **options):
    """The one thing that is wrong: its severity, and what is said of it."""
    found = bad(facts, **options)
    assert list(found) == [name]
    return found[name]


def test_of_a_good_bag_all_is_well(facts):
    found = findings(facts)
    assert not bad(facts)
    assert len(found) > 12
    assert found["odometry_rate"].value == "20 Hz"
    # lines 15 m apart with a swath of 40 m: 62 % lie over the line before, half of it 60 s earlier
    assert 0.2 < overlap(facts)[0] < 0.5


# Times


def test_seldom_odometry(facts):
    facts.odometry = {name: column[::20] for name, column in facts.odometry.items()}
    for name in ("var_u", "var_v", "var_r"):
        facts.odometry[name] /= 20  # of the same noise a second
    assert only(facts, "odometry_rate")[0] == WARNING


def test_gaps_of_the_odometry(facts):
    kept = np.ones(len(facts.odometry["stamp_s"]), dtype=bool)
    kept[1000:1100] = kept[3000:3200] = False
    facts.odometry = {name: column[kept] for name, column in facts.odometry.items()}
    severity, text = only(facts, "odometry_gaps")
    assert severity == WARNING and "2 gaps; longest step 10 s, at 150 s" in text


def test_a_pause_of_the_sonar(facts):
    kept = np.ones(len(facts.placed["stamp_s"]), dtype=bool)
    kept[100:200] = False
    facts.beams = {
        name: column[kept[facts.beams["ping"].astype(int)]] for name, column in facts.beams.items()
    }
    facts.beams["ping"] = np.searchsorted(np.flatnonzero(kept), facts.beams["ping"])
    facts.placed = {name: column[kept] for name, column in facts.placed.items()}
    severity, text = only(facts, "ping_rate")
    assert severity == WARNING and "longest pause 50 s" in text


@pytest.mark.parametrize(
    ("ahead_s", "said"), [(5.0, "5.0 s after"), (-90.0, "90.0 s before"), (-5.0, "")]
)
@pytest.mark.parametrize("name", ["odometry", "ping"])
def test_clocks(facts, name, ahead_s, said):
    table = facts.odometry if name == "odometry" else facts.pings
    table["record_s"] = table["stamp_s"] - ahead_s
    if not said:
        assert not bad(facts)
    else:
        assert said in only(facts, f"{name}_clock")[1]


# Frames, mounts, refusals


def test_frames_that_the_overlay_sets_are_an_error_only_with_a_config(facts):
    frames = facts.parameters["frames"]
    other = topic("/nav", "nav_msgs/Odometry", "hull", "world")
    assert frames_of_bag(other, frames) == {"odom": "world", "base": "hull"}
    (without,) = odometry_frame_findings(other, frames, config_is_given=False)
    (given,) = odometry_frame_findings(other, frames, config_is_given=True)
    assert (without.severity, given.severity) == (WARNING, ERROR)
    assert "frames: {odom: world, base: hull}" in given.fix
    (good,) = odometry_frame_findings(
        other, {**frames, **frames_of_bag(other, frames)}, config_is_given=True
    )
    assert good.severity == OK


def test_odometry_in_map_and_without_a_child_is_taken_as_it_is(facts):
    odometry = topic("/nav", "nav_msgs/Odometry", "", "map")
    (finding,) = odometry_frame_findings(odometry, facts.parameters["frames"], True)
    assert finding.severity == OK
    assert "given in map" in finding.value and "taken for 'base_link'" in finding.value


@pytest.mark.parametrize(
    ("mount", "severity", "said"),
    [
        (Mount("mbes"), ERROR, "base_link → mbes; /tf_static was not recorded"),
        (Mount("odom"), ERROR, "placed by the navigation already"),
        (Mount("mbes", (300.0, 0.0, -600.0), (0.0, 0.0, 0.0)), ERROR, "millimetres"),
        (Mount("mbes", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), WARNING, "never entered"),
    ],
)
def test_mounts(facts, mount, severity, said):
    facts.mounts = [mount]
    found = only(facts, "mount")
    assert found[0] == severity and said in found[1]


def test_refusals_are_errors_where_nothing_is_left(facts):
    facts.refused = {"pings/not_finite": Refused(3, "NaN"), "pings/no_mount": Refused(3, "none")}
    severity, text = only(facts, "refused_pings_not_finite")
    assert severity == WARNING and "3 of 560 messages; the first: NaN" in text
    facts.placed = {name: column[:0] for name, column in facts.placed.items()}
    facts.beams = {name: column[:0] for name, column in facts.beams.items()}
    assert only(facts, "refused_pings_not_finite")[0] == ERROR


def test_pings_that_wait_for_odometry_in_vain_are_not_told_of_twice(facts):
    for table in (facts.odometry, facts.placed, facts.beams):
        table.update({name: column[:0] for name, column in table.items()})
    facts.refused = {
        "odometry/wrong_frame": Refused(4000, "another"),
        "pings/no_odometry": Refused(560, "none"),
    }
    assert only(facts, "refused_odometry_wrong_frame")[0] == ERROR


# Beams


def test_beams(facts):
    for name in ("beams", "finite", "within"):
        facts.pings[name][:] = 4.0
    facts.placed["good"][:] = 4.0
    assert "altimeter" in only(facts, "beams_per_ping")[1]


def test_beams_that_are_not_finite(facts):
    facts.pings["beams"] *= 2
    assert "50.0 %" in only(facts, "not_finite")[1]


def test_beams_out_of_range(facts):
    facts.pings["within"] -= 4
    facts.placed["good"] -= 4
    assert "19.0 % refused" in only(facts, "ranges")[1]


def test_beams_in_millimetres(facts):
    for name in ("min_range_m", "median_range_m", "max_range_m"):
        facts.pings[name] *= 1000
    assert "millimetres" in only(facts, "travel_time")[1]


def test_outliers(facts):
    facts.placed["good"] -= 8
    assert "38.1 %" in only(facts, "outliers")[1]


# Geometry


def test_a_swath_along_the_vehicle(facts):
    facts.placed["min_forward_m"], facts.placed["max_forward_m"] = (
        facts.placed["min_left_m"],
        facts.placed["max_left_m"],
    )
    facts.placed["min_left_m"] = facts.placed["max_left_m"] = np.zeros(len(facts.placed["good"]))
    assert "yaw is wrong by 90°" in only(facts, "swath")[1]


def test_no_overlap(facts):
    first_line = facts.beam_stamps() < START_S + 45.0
    facts.beams = {name: column[first_line] for name, column in facts.beams.items()}
    assert only(facts, "overlap")[1].startswith("0 %")


def test_overlap_tells_how_far_depths_are_apart(facts):
    facts.beams["z_m"] += 0.01 * (facts.beam_stamps() - START_S)  # a tide
    share, apart_m, _ = overlap(facts)
    assert share > 0.2 and 0.6 <= apart_m <= 2.8


def test_an_area_that_is_too_small(facts):
    tenth = [[0.0, 0.0], [20.0, 0.0], [20.0, 20.0], [0.0, 20.0]]
    assert only(facts, "survey_area", area=tenth)[0] == WARNING


def test_what_the_filter_itself_has_noted(facts):
    text = "none lies in it. Likely cause: UTM"
    facts.noted = [Noted("area_missed", ERROR, text), Noted("mount_changed", WARNING, "moved")]
    found = bad(facts)
    assert found == {
        "area_missed": (ERROR, "none lies in it; UTM"),
        "mount_changed": (WARNING, "moved; "),
    }
    assert list(bad(facts, area=[])) == ["mount_changed"]


# Motion


@pytest.mark.parametrize(
    ("velocity", "severity"), [("auto", WARNING), ("twist", ERROR), ("pose", OK)]
)
def test_an_empty_twist(facts, velocity, severity):
    facts.odometry["u_mps"][:] = 0.0
    facts.parameters["odometry"]["velocity"] = velocity
    facts.noted = [Noted("twist_against_pose", ERROR, "empty")]
    assert findings(facts)["twist"].severity == severity
    assert set(bad(facts)) <= {"twist"}


def test_a_twist_that_contradicts_the_pose(facts):
    facts.noted = [Noted("twist_against_pose", ERROR, "it turns. Likely cause: degrees")]
    assert only(facts, "twist_against_pose") == (ERROR, "it turns; degrees")


def test_a_pose_that_jumps(facts):
    facts.odometry["x_m"][2000:] += 30.0
    assert "1 jump, the largest 29.9 m" in only(facts, "track")[1]


def test_a_pose_in_millimetres(facts):
    facts.odometry["x_m"] *= 1000.0
    facts.odometry["y_m"] *= 1000.0
    assert "millimetres" in only(facts, "track")[1]


def test_a_pose_that_rests(facts):
    facts.odometry["x_m"][:] = facts.odometry["y_m"][:] = 1.0
    assert "lay still" in only(facts, "track")[1]


def test_noise_that_is_far_from_the_data(facts):
    severity, text = only(facts, "motion_noise", surge_std_m=0.6)
    assert severity == WARNING and "surge_std_m 0.6" in text
    facts.odometry["var_u"][:] = facts.odometry["var_v"][:] = 0.0
    assert "nothing to compare with" in findings(facts, surge_std_m=0.6)["motion_noise"].value


# Topics


def choice(*topics, **given):
    chosen, found = choose_topics(list(topics), **given)
    return chosen, {finding.name: finding for finding in found}


def test_topics_are_found_by_type_and_name():
    camera = topic("/depth/points", "sensor_msgs/PointCloud2")
    other = topic("/nav/processed/odometry", "nav_msgs/Odometry", "base_link", "map")
    chosen, found = choice(camera, TRUTH, PINGS, other)
    assert chosen == ChosenTopics(other, PINGS, TRUTH)
    assert found["odometry_topic"].severity == OK
    assert found["pings_topic"].severity == WARNING  # another cloud could be meant
    assert "/depth/points" in found["pings_topic"].value


def test_topics_that_are_named():
    other = topic("/fast/odom", "nav_msgs/Odometry", "base_link")
    chosen, found = choice(other, ODOMETRY, PINGS, odometry="odom", pings="/mbes/pings")
    assert chosen == ChosenTopics(ODOMETRY, PINGS) and count(found.values(), OK) == 2
    chosen, found = choice(ODOMETRY, PINGS, odometry="/odometry", pings="/odom")
    assert chosen == ChosenTopics(None, None)
    assert "/odom could be meant" in found["odometry_topic"].fix
    assert "/odom is nav_msgs/Odometry" in found["pings_topic"].value


def test_topics_that_are_not_there():
    chosen, found = choice(TRUTH, topic("/imu", "sensor_msgs/Imu"))
    assert chosen.odometry is None and chosen.pings is None
    assert {finding.severity for finding in found.values()} == {ERROR}
    assert "/imu (sensor_msgs/Imu)" in found["pings_topic"].cause


# What a user reads


def test_the_worst_comes_first_and_what_is_well_is_short(facts):
    fine = Finding("a", OK, "1 Hz", "2 Hz", "none", "nothing")
    wrong = Finding("longer_name", ERROR, "word " * 40, "other", "this", "that")
    assert worst_first([fine, wrong]) == [wrong, fine]
    text = findings_text([fine, wrong])
    assert text.startswith("ERROR     longer_name  word word")
    assert max(map(len, text.splitlines())) <= 100
    assert text.splitlines()[-1] == "ok        a            1 Hz"
    assert [line.split()[0] for line in text.splitlines()[-4:-1]] == ["expected", "likely", "fix"]
    assert summary("f.bag", [fine, wrong]) == "f.bag: SLAM would fail: 1 error, 0 warnings"
    assert summary("f.bag", [fine]) == "f.bag: SLAM can run: 0 errors, 0 warnings"
