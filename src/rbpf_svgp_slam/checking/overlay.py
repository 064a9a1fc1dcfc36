"""The overlay on config/default.yaml that suits a bag. Needs no ROS."""

from __future__ import annotations

import json
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rbpf_svgp_slam.checking.area_of_beams import area_of_beams
from rbpf_svgp_slam.checking.facts import ChosenTopics, Facts
from rbpf_svgp_slam.checking.frames import frames_of_bag
from rbpf_svgp_slam.checking.motion import twist_is_empty
from rbpf_svgp_slam.checking.noise import NAMES, motion_noise

#: More beams than this share beyond pings/max_range_m: the bound is raised, with room for more.
MOST_BEYOND, ROOM = 0.01, 1.2


@dataclass(frozen=True)
class Overlay:
    """Parameters that differ from the defaults, and a comment above each."""

    groups: dict[str, Any]
    comments: dict[str, str]

    def text(
        self, bag: Path, chosen: ChosenTopics, path: Path, written_by: str = "check_bag.py"
    ) -> str:
        """The file, with the command that takes it."""
        lines = [
            f"# Overlay on config/default.yaml for {bag.name}, by {written_by}. Then:",
            "#",
            f"# {command(bag, chosen, path)}",
            "",
        ]
        for name, value in self.groups.items():
            lines += [f"# {line}" for line in self.comments[name].splitlines()]
            if isinstance(value, dict):
                lines += [
                    f"{name}:",
                    *(f"  {key}: {json.dumps(item)}" for key, item in value.items()),
                ]
            else:
                lines.append(f"{name}: {value}")
            lines.append("")
        return "\n".join(lines)


def command(bag: Path, chosen: ChosenTopics, overlay: Path) -> str:
    """How the bag is replayed with the overlay."""
    arguments = [f"bag:={bag.resolve()}", f"config:={overlay.resolve()}"]
    for name, topic in (
        ("odom_topic", chosen.odometry),
        ("ping_topic", chosen.pings),
        ("ground_truth_topic", chosen.ground_truth),
    ):
        if topic:
            arguments.append(f"{name}:={topic.name}")
    out = bag.resolve().with_suffix("")
    words = ["roslaunch", "rbpf_svgp_slam", "offline.launch", *arguments, f"out:={out}"]
    return " ".join(map(shlex.quote, words))


def make_overlay(facts: Facts, defaults: dict[str, Any]) -> Overlay:
    """What the bag tells; defaults: the tree of config/default.yaml."""
    groups: dict[str, Any] = {}
    comments = {}
    frames = frames_of_bag(facts.chosen.odometry, defaults["frames"])
    if frames:
        groups["frames"], comments["frames"] = frames, "As the odometry's messages name them."
    area = area_of_beams(facts)
    if area:
        groups["survey_area"] = area
        comments["survey_area"] = (
            "Around all that the beams have reached, placed by the odometry. Make it smaller where "
            "there is\nmuch of it without seabed: inducing points are laid out over all of it."
        )
    noise = motion_noise(facts, {name: defaults["motion"][name] for name in NAMES})
    groups["motion"] = {name: _number(value) for name, value in noise.values.items()}
    comments[
        "motion"
    ] = f"{noise.source[0].upper()}{noise.source[1:]}. Per square root of a second."
    _add_velocity(facts, groups, comments)
    _add_max_range(facts, defaults, groups, comments)
    return Overlay(groups, comments)


def _add_velocity(facts: Facts, groups: dict, comments: dict) -> None:
    if not len(facts.odometry["stamp_s"]):
        return
    if twist_is_empty(facts.odometry):
        reason = "The odometry's twist is all zeros: the motion is taken from its pose."
    elif any(noted.name == "twist_against_pose" for noted in facts.noted):
        reason = "The odometry's twist contradicts its pose, from which the motion is taken."
    else:
        return
    groups["odometry"], comments["odometry"] = {"velocity": "pose"}, reason


def _add_max_range(facts: Facts, defaults: dict[str, Any], groups: dict, comments: dict) -> None:
    most_m = facts.pings["max_range_m"]
    bound_m = defaults["pings"]["max_range_m"]
    median_m = facts.pings["median_range_m"]
    if (
        not np.isfinite(most_m).any()
        or (most_m[np.isfinite(most_m)] > bound_m).mean() <= MOST_BEYOND
    ):
        return
    # single echoes from nowhere do not count
    usual_m = min(np.nanpercentile(most_m, 99), 3 * np.nanpercentile(median_m, 99))
    if usual_m <= bound_m:
        return
    groups["pings"] = {"max_range_m": float(np.ceil(ROOM * usual_m))}
    comments["pings"] = f"Ranges reach {usual_m:.0f} m; the default is {bound_m:g} m."


def _number(value: float) -> float:
    """To two digits."""
    return float(f"{value:.2g}")
