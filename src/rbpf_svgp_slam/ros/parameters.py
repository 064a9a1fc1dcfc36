"""Loads and validates the parameters of the map nodes.

The core checks the groups that only it uses. Nothing is imported here that starts a numerical
library: the number of threads, a parameter, must be known before.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rbpf_svgp_slam.ros.rules import (
    Rule,
    at_least,
    choice,
    flag,
    integer,
    name,
    polygon,
    positive,
)

GROUP = "rbpf_svgp_slam"
MISSING = object()

Polygon = tuple[tuple[float, float], ...]


class ParameterError(ValueError):
    """A parameter is unknown, missing, of the wrong type or out of range."""


@dataclass(frozen=True)
class MapParameters:
    """Group `map`."""

    engine: str
    threads: int
    resolution_m: float
    publish_period_s: float


@dataclass(frozen=True)
class NodeParameters:
    """Everything that a map node is configured with."""

    particles: int
    nodes: int
    seed: int
    survey_area: Polygon  # vertices (x, y), frame map, m
    map_frame: str
    resampling_timeout_s: float
    map: MapParameters
    svgp: dict[str, Any]  # group `svgp` as in the yaml file


# Every parameter under `map/` and `svgp/`, and those of other groups that a map node needs.
COMMON_RULES = {
    "particles": integer(1),
    "nodes": integer(1),
    "seed": integer(0, 2**31 - 1),
    "survey_area": polygon(),
    "frames/map": name(),
    "resampling/timeout_s": positive(),
}
MAP_RULES = {
    "engine": choice("svgp"),
    "threads": integer(1),
    "resolution_m": positive(),
    "publish_period_s": at_least(0.0),
}
SVGP_RULES = {
    "inducing_points": integer(1),
    "minibatch_size": integer(1),
    "kernel": choice("matern12", "matern32", "matern52"),
    "optimizer": choice("adam"),
    "learning_rate": positive(),
    "lengthscale_m": positive(),
    "outputscale_m2": positive(),
    "noise_std_m": positive(),
    "jitter": positive(below=1.0),
    "learn_inducing_points": flag(),
    "learn_hyperparameters": flag(),
    "convergence/decay": positive(below=1.0),
    "convergence/window": integer(1),
    "convergence/tolerance": positive(),
    "device": choice("cpu", "cuda"),
}


def validate(tree: dict[str, Any]) -> NodeParameters:
    """The parameters from the tree below `rbpf_svgp_slam/`; raises ParameterError."""
    if not isinstance(tree, dict) or not tree:
        raise ParameterError(f"{GROUP} is not set; expected the parameters of config/default.yaml")
    common = {path: _value(tree, path, rule) for path, rule in COMMON_RULES.items()}
    if common["nodes"] > common["particles"]:
        raise ParameterError(
            f"{GROUP}/nodes is {common['nodes']}; expected at most {common['particles']}, "
            f"{GROUP}/particles"
        )
    return NodeParameters(
        particles=common["particles"],
        nodes=common["nodes"],
        seed=common["seed"],
        survey_area=common["survey_area"],
        map_frame=common["frames/map"],
        resampling_timeout_s=common["resampling/timeout_s"],
        map=MapParameters(**_group(tree, "map", MAP_RULES)),
        svgp=_group(tree, "svgp", SVGP_RULES),
    )


def validate_index(index: Any, nodes: int) -> int:
    """The private parameter ~index."""
    rule = integer(0, nodes - 1)
    if not rule.accepts(index):
        shown = "not set" if index is None else repr(index)
        raise ParameterError(f"~index is {shown}; expected {rule.expected}")
    return index


def _group(tree: dict[str, Any], group: str, rules: dict[str, Rule]) -> dict[str, Any]:
    """All values of a group, nested as in the tree; paths without a rule are refused."""
    for path in _leaves(tree.get(group, {})):
        if path not in rules:
            raise ParameterError(
                f"{GROUP}/{group}/{path} is unknown; expected one of {', '.join(sorted(rules))}"
            )
    values: dict[str, Any] = {}
    for path, rule in rules.items():
        *branches, leaf = path.split("/")
        branch = values
        for part in branches:
            branch = branch.setdefault(part, {})
        branch[leaf] = _value(tree, f"{group}/{path}", rule)
    return values


def _value(tree: dict[str, Any], path: str, rule: Rule) -> Any:
    value: Any = tree
    for part in path.split("/"):
        value = value.get(part, MISSING) if isinstance(value, dict) else MISSING
    if value is MISSING:
        raise ParameterError(f"{GROUP}/{path} is not set; expected {rule.expected}")
    if not rule.accepts(value):
        raise ParameterError(f"{GROUP}/{path} is {value!r}; expected {rule.expected}{_hint(value)}")
    return rule.convert(value)


def _leaves(tree: Any, prefix: str = "") -> list[str]:
    if not isinstance(tree, dict):
        return [prefix.rstrip("/")]
    return [leaf for part, below in tree.items() for leaf in _leaves(below, f"{prefix}{part}/")]


def _hint(value: Any) -> str:
    """YAML 1.1 takes 1e-4 for text."""
    try:
        float(value if isinstance(value, str) else "")
    except ValueError:
        return ""
    return "; this is text: in YAML write 1.0e-4, not 1e-4, and no quotes"
