"""The overlay that suits a bag: it loads, and holds what the bag tells."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from made_up_facts import (
    HALF_SWATH_M,
    LENGTH_M,
    ODOMETRY,
    PINGS,
    START_S,
    SURGE_STD_M,
    SWAY_STD_M,
    TRUTH,
    YAW_STD_RAD,
    make_facts,
    topic,
)

from rbpf_svgp_slam.checking.area_of_beams import area_of_beams
from rbpf_svgp_slam.checking.facts import ChosenTopics, Noted
from rbpf_svgp_slam.checking.noise import motion_noise
from rbpf_svgp_slam.checking.overlay import command, make_overlay
from rbpf_svgp_slam.nested import merged
from rbpf_svgp_slam.parameters.known import default_parameters
from rbpf_svgp_slam.parameters.loading import validate
from rbpf_svgp_slam.survey_area.polygon import inside

OVERLAY, BAG = Path("/bags/my survey.check.yaml"), Path("/bags/my survey.bag")
MOTION = {"surge_std_m": 0.05, "sway_std_m": 0.05, "yaw_std_rad": 0.001}


@pytest.fixture
def facts():
    return make_facts()


def loaded(facts):
    """The overlay as it is read back and accepted."""
    text = make_overlay(facts, default_parameters()).text(BAG, facts.chosen, OVERLAY)
    overlay = yaml.safe_load(text)
    validate(merged(default_parameters(), overlay))
    return overlay, text


def turned(facts, angle):
    """The survey along lines of another heading."""
    x, y = facts.beams["x_m"], facts.beams["y_m"]
    c, s = np.cos(angle), np.sin(angle)
    facts.beams["x_m"], facts.beams["y_m"] = c * x - s * y, s * x + c * y
    return np.column_stack([facts.beams["x_m"], facts.beams["y_m"]])


def test_it_holds_only_what_differs_and_loads(facts):
    overlay, text = loaded(facts)
    assert list(overlay) == ["survey_area", "motion"]
    assert overlay["motion"] == {
        "surge_std_m": SURGE_STD_M,
        "sway_std_m": SWAY_STD_M,
        "yaw_std_rad": YAW_STD_RAD,
    }
    assert "# From the odometry's own twist covariance." in text
    assert max(map(len, text.splitlines()[3:])) <= 100


def test_it_begins_with_the_command(facts):
    chosen = ChosenTopics(ODOMETRY, PINGS, TRUTH)
    line = command(BAG, chosen, OVERLAY)
    assert line.startswith("roslaunch rbpf_svgp_slam offline.launch 'bag:=/bags/my survey.bag'")
    for argument in ("odom_topic:=/odom", "ping_topic:=/mbes/pings", "ground_truth_topic:=/gr"):
        assert argument in line
    assert f"# {command(BAG, facts.chosen, OVERLAY)}\n" in loaded(facts)[1]


def test_frames_and_velocity(facts):
    other = topic("/nav", "nav_msgs/Odometry", "hull", "world")
    facts.chosen = ChosenTopics(other, PINGS)
    facts.odometry["u_mps"][:] = 0.0
    overlay, text = loaded(facts)
    assert overlay["frames"] == {"odom": "world", "base": "hull"}
    assert overlay["odometry"] == {"velocity": "pose"} and "all zeros" in text


def test_a_twist_that_contradicts_the_pose_is_not_used(facts):
    facts.noted = [Noted("twist_against_pose", "error", "")]
    assert loaded(facts)[0]["odometry"] == {"velocity": "pose"}


def test_deep_water_raises_the_longest_range(facts):
    for name in ("min_range_m", "median_range_m", "max_range_m"):
        facts.pings[name] *= 40.0
    overlay, _ = loaded(facts)
    usual_m = facts.pings["max_range_m"][0]
    assert usual_m < overlay["pings"]["max_range_m"] < 1.5 * usual_m
    facts.pings["max_range_m"][:] = 480.0
    facts.pings["max_range_m"][7] = 5000.0  # an echo from nowhere
    assert "pings" not in loaded(facts)[0]


# The area


@pytest.mark.parametrize("angle", [0.0, 0.03, 0.6, 2.0])
@pytest.mark.parametrize("origin_m", [0.0, 500_000.0])
def test_the_area_holds_all_beams_and_little_more(facts, angle, origin_m):
    points = turned(facts, angle) + origin_m
    facts.beams["x_m"], facts.beams["y_m"] = points.T
    area = np.array(area_of_beams(facts))
    assert inside(points, area).mean() > 0.99  # those on the very edge may count as outside
    assert (area == np.round(area)).all()
    x, y = area.T
    size = 0.5 * abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    assert size < 1.35 * LENGTH_M * (60.0 + 2 * HALF_SWATH_M) * 1.25


def test_single_beams_from_far_away_do_not_count(facts):
    before = area_of_beams(facts)
    facts.beams["x_m"][5], facts.beams["left_m"][5] = 2000.0, 2000.0
    assert area_of_beams(facts) == before


def test_beams_on_one_line_have_an_area_too(facts):
    facts.beams["y_m"][:] = 3.0
    validate({**default_parameters(), "survey_area": area_of_beams(facts)})


# Noise


def with_truth(facts, **std):
    """The pose drifts against a ground truth, by a random walk in the body frame."""
    rng = np.random.default_rng(5)
    names = "record_s stamp_s x_m y_m z_m roll_rad pitch_rad yaw_rad".split()
    facts.ground_truth = {name: facts.odometry[name].copy() for name in names}
    n, root = len(facts.odometry["stamp_s"]), np.sqrt(1 / 20.0)
    for name, column in (("surge", "x_m"), ("sway", "y_m"), ("yaw", "yaw_rad")):
        walk = np.cumsum(rng.normal(0.0, std[name] * root, n))
        facts.odometry[column] = facts.odometry[column] + walk
    for name in ("var_u", "var_v", "var_r"):
        facts.odometry[name][:] = 0.0


def test_noise_against_ground_truth(facts):
    with_truth(facts, surge=0.1, sway=0.1, yaw=0.001)
    noise = motion_noise(facts, MOTION)
    assert noise.is_measured and "ground truth" in noise.source
    for name, std in (("surge_std_m", 0.1), ("sway_std_m", 0.1), ("yaw_std_rad", 0.001)):
        # of 55 windows, a standard deviation is known to a tenth; three of these
        assert noise.values[name] == pytest.approx(std, rel=0.3)


def test_jumps_of_the_ground_truth_do_not_count(facts):
    with_truth(facts, surge=0.1, sway=0.1, yaw=0.001)
    later = facts.ground_truth["stamp_s"] > START_S + 102.0
    facts.ground_truth["x_m"][later] += 50.0
    facts.ground_truth["y_m"][::97] = np.nan
    assert motion_noise(facts, MOTION).values["surge_std_m"] == pytest.approx(0.1, rel=0.3)


def test_without_either_the_defaults_stay_and_say_so(facts):
    for name in ("var_u", "var_v", "var_r"):
        facts.odometry[name][:] = 1e-6  # no vehicle is so good
    noise = motion_noise(facts, MOTION)
    assert not noise.is_measured and noise.values == MOTION
    overlay, text = loaded(facts)
    assert overlay["motion"] == MOTION and "# The defaults: the bag does not tell" in text
