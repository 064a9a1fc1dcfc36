"""The command line that says what SLAM would meet in a bag, and writes the overlay for it."""

from __future__ import annotations

import argparse
import copy
import shlex
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from rbpf_svgp_slam.checking.beams import beam_findings
from rbpf_svgp_slam.checking.facts import ChosenTopics, Facts
from rbpf_svgp_slam.checking.findings import ERROR, Finding, count
from rbpf_svgp_slam.checking.frames import (
    frames_of_bag,
    mount_findings,
    odometry_frame_findings,
)
from rbpf_svgp_slam.checking.geometry import geometry_findings
from rbpf_svgp_slam.checking.inspector import BagError, inspect, topics_of
from rbpf_svgp_slam.checking.motion import motion_findings
from rbpf_svgp_slam.checking.noise import NAMES, motion_noise, noise_finding
from rbpf_svgp_slam.checking.noted_by_filter import noted_findings
from rbpf_svgp_slam.checking.overlay import command, make_overlay
from rbpf_svgp_slam.checking.refusals_found import refusal_findings
from rbpf_svgp_slam.checking.terminal import findings_text, summary
from rbpf_svgp_slam.checking.timing import timing_findings
from rbpf_svgp_slam.checking.topic_choice import choose_topics
from rbpf_svgp_slam.nested import merged
from rbpf_svgp_slam.parameters.known import default_parameters
from rbpf_svgp_slam.parameters.loading import validate
from rbpf_svgp_slam.parameters.rules import ParameterError

_DESCRIPTION = """Say what SLAM would meet in a bag, as its own nodes would read it: topics, rates,
clocks, frames, mounts, beams, depths, motion. Each finding has its value, what was expected, the
likely cause and a fix. Exit status 1 if SLAM would fail, 0 otherwise, 2 for a mistake in the
arguments.

An overlay on config/default.yaml that suits the bag is written beside it."""

#: Stands in for a survey area that nobody has given yet, so that the rest can be read.
_ANY_AREA = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
_NO_AREA = Finding(
    "survey_area",
    ERROR,
    "not set",
    "a polygon [[x, y], ...] in map, m: the seabed to be mapped",
    "no config was given, or it does not have it",
    "check_bag.py without a config writes an overlay that has one",
)


@dataclass
class Check:
    """What has come out of a bag."""

    chosen: ChosenTopics
    findings: list[Finding] = field(default_factory=list)
    facts: Facts | None = None  # None if there is nothing to read


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns the exit status."""
    options = _parse(argv)
    if not options.bag.is_file():
        print(f"check_bag.py: error: {options.bag}: no such file", file=sys.stderr)
        return 2
    result = check(options)
    failed = count(result.findings, ERROR) > 0
    line = summary(options.bag.name, result.findings)
    if options.quiet_if_good:
        if failed:
            text = f"{findings_text(_bad(result))}\n\n{line}\n{_hint(options)}"
            print(f"\n{text}\n", file=sys.stderr)
        print(line)
        return int(failed)
    print(findings_text(result.findings))
    print(f"\n{line}")
    if result.facts:
        _write_overlay(options, result)
    return int(failed)


def _parse(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="check_bag.py",
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("bag", metavar="F.bag", type=Path)
    overlays = "overlays that SLAM would be given, in their order; they are checked against the bag"
    add("config", metavar="config.yaml", type=Path, nargs="*", help=overlays)
    add("--odom", metavar="TOPIC", default="", help="default: found by its type and name")
    add("--pings", metavar="TOPIC", default="", help="default: found by its type and name")
    truth = "default: found by its name"
    add("--ground-truth", metavar="TOPIC", default="", help=truth)
    out = "the overlay to write (default: F.check.yaml beside the bag)"
    add("--out", metavar="OVERLAY.yaml", type=Path, help=out)
    quiet = (
        "for launch files: write no overlay, and say nothing but one line unless SLAM would fail"
    )
    add("--quiet-if-good", action="store_true", help=quiet)
    return parser.parse_args(argv)


def check(options: argparse.Namespace) -> Check:
    """All findings on a bag."""
    try:
        topics = topics_of(options.bag)
    except BagError as error:
        fix = "rosbag reindex, if the recording was cut off"
        finding = Finding("bag", ERROR, f"{error}", "a whole bag", "", fix)
        return Check(ChosenTopics(None, None), [finding])
    chosen, findings = choose_topics(topics, options.odom, options.pings, options.ground_truth)
    result = Check(chosen, findings)
    tree = _parameters(options, result)
    if chosen.odometry is None:
        return result
    frames = tree["frames"]
    result.findings += odometry_frame_findings(chosen.odometry, frames, bool(options.config))
    if chosen.pings is None:
        return result
    read_with = copy.deepcopy(tree)
    # as the overlay will have it: what else is wrong is seen all the same
    read_with["frames"].update(frames_of_bag(chosen.odometry, frames))
    read_with["survey_area"] = tree["survey_area"] or _ANY_AREA
    try:
        result.facts = inspect(options.bag, topics, chosen, read_with)
    except BagError as error:
        result.findings.append(Finding("bag", ERROR, f"{error}", "one that can be read"))
        return result
    except ParameterError as error:  # of what only the core looks at
        result.findings.append(_config_finding(error))
        return result
    result.findings += judge(result.facts, tree)
    return result


def judge(facts: Facts, tree: dict[str, Any]) -> list[Finding]:
    """Of what has been read; tree: the parameters that SLAM would have."""
    noise = motion_noise(facts, default_parameters()["motion"])
    return [
        *refusal_findings(facts),
        *noted_findings(facts, area_is_given=bool(tree["survey_area"])),
        *timing_findings(facts),
        *mount_findings(facts),
        *beam_findings(facts),
        *geometry_findings(facts, tree["survey_area"]),
        *motion_findings(facts),
        noise_finding(noise, {name: tree["motion"][name] for name in NAMES}),
    ]


def _parameters(options: argparse.Namespace, result: Check) -> dict[str, Any]:
    """The defaults with the overlays; the defaults alone if those are not good."""
    defaults = default_parameters()
    if not options.config:
        return defaults
    tree = defaults
    try:
        for path in options.config:
            overlay = yaml.safe_load(path.read_text(encoding="utf-8")) or {}
            if not isinstance(overlay, dict):
                raise ParameterError(f"{path}: expected names and values")
            tree = merged(tree, overlay)
        if not tree["survey_area"]:
            result.findings.append(_NO_AREA)
        validate({**tree, "survey_area": tree["survey_area"] or _ANY_AREA})
    except (OSError, UnicodeDecodeError, yaml.YAMLError, ParameterError) as error:
        result.findings.append(_config_finding(error))
        return defaults
    return tree


def _config_finding(error: Exception) -> Finding:
    text = " ".join(str(error).split())
    fix = "check_bag.py without a config writes one that suits the bag"
    return Finding("config", ERROR, text, "an overlay on config/default.yaml", "", fix)


def _hint(options: argparse.Namespace) -> str:
    """What to do about a launch that is stopped."""
    words = ["rosrun", "rbpf_svgp_slam", "check_bag.py", str(options.bag)]
    for name, topic in (("--odom", options.odom), ("--pings", options.pings)):
        words += [name, topic] if topic else []
    command_line = " ".join(map(shlex.quote, words))
    return f"All findings, and an overlay: {command_line}\nWithout this check: check:=false"


def _bad(result: Check) -> list[Finding]:
    return [finding for finding in result.findings if finding.severity != "ok"]


def _write_overlay(options: argparse.Namespace, result: Check) -> None:
    path = options.out or options.bag.with_suffix(".check.yaml")
    overlay = make_overlay(result.facts, default_parameters())
    try:
        path.write_text(overlay.text(options.bag, result.chosen, path), encoding="utf-8")
    except OSError as error:
        print(f"check_bag.py: no overlay: {error}; give --out OVERLAY.yaml", file=sys.stderr)
        return
    print(f"overlay: {path}\n\n{command(options.bag, result.chosen, path)}")
