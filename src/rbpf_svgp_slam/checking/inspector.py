"""Runs rbpf_inspect_bag, which reads bags as the filter's own nodes do."""

from __future__ import annotations

import subprocess
import tempfile
import xmlrpc.client
from pathlib import Path
from typing import Any

from roslib.packages import find_node

from rbpf_svgp_slam.checking.facts import ChosenTopics, Facts, Topic, load_facts, topics_from
from rbpf_svgp_slam.parameters.known import PACKAGE
from rbpf_svgp_slam.parameters.rules import ParameterError

PROGRAM = "rbpf_inspect_bag"
#: Its exit status where a parameter is not what it should be.
WRONG_PARAMETER = 2


class BagError(ValueError):
    """A bag cannot be read."""


def topics_of(bag: Path) -> list[Topic]:
    """All topics of a bag; raises BagError."""
    return topics_from(_run([str(bag)]))


def inspect(
    bag: Path, topics: list[Topic], chosen: ChosenTopics, parameters: dict[str, Any]
) -> Facts:
    """Read a bag's odometry and pings with a tree of parameters.

    Raises BagError, or ParameterError if the filter would refuse the parameters.
    """
    names = [chosen.odometry.name, chosen.pings.name]
    if chosen.ground_truth:
        names.append(chosen.ground_truth.name)
    with tempfile.TemporaryDirectory(prefix="check_bag.") as folder:
        _run([str(bag), folder, *names], _as_xml(parameters))
        return load_facts(Path(folder), topics, chosen, parameters)


def _as_xml(parameters: dict[str, Any]) -> str:
    """A tree as the parameter server sends it; raises ParameterError."""
    try:
        text = xmlrpc.client.dumps((parameters,))
    except (TypeError, OverflowError) as error:
        raise ParameterError(f"a parameter has no value that can be sent: {error}") from None
    return text[text.index("<value>") : text.rindex("</param>")]


def _run(arguments: list[str], text: str = "") -> str:
    programs = find_node(PACKAGE, PROGRAM)
    if not programs:
        raise BagError(f"{PROGRAM} is not there; is {PACKAGE} built, and its workspace sourced?")
    done = subprocess.run(
        [programs[0], *arguments], input=text, capture_output=True, text=True, errors="replace"
    )
    problem = " ".join(done.stderr.split())
    if done.returncode == WRONG_PARAMETER:
        raise ParameterError(problem)
    if done.returncode != 0:
        raise BagError(problem or f"{PROGRAM} ended with status {done.returncode}")
    return done.stdout
