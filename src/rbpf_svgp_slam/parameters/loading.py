"""Loads and validates the parameters of the map nodes.

The core checks the groups that only it uses. Nothing is imported here that starts a numerical
library: the number of threads, a parameter, must be known before.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rbpf_svgp_slam.maps.registry import ENGINES
from rbpf_svgp_slam.parameters.rules import (
    Rule,
    at_least,
    choice,
    group,
    integer,
    name,
    polygon,
    positive,
)
from rbpf_svgp_slam.protocol.names import PARAMETERS

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
    engine_group: dict[str, Any]  # the group of the name `map/engine`, for that engine to check


# Every parameter under `map/`, and those of other groups that a map node needs. The engine's own
# group is checked by the engine's settings.
COMMON_RULES = {
    "particles": integer(1),
    "nodes": integer(1),
    "seed": integer(0, 2**31 - 1),
    "survey_area": polygon(),
    "frames/map": name(),
    "resampling/timeout_s": positive(),
}
MAP_RULES = {
    "engine": choice(*ENGINES),
    "threads": integer(1),
    "resolution_m": positive(),
    "publish_period_s": at_least(0.0),
}


def validate(tree: dict[str, Any]) -> NodeParameters:
    """The parameters from the tree below `rbpf_svgp_slam/`; raises ParameterError."""
    if not isinstance(tree, dict) or not tree:
        raise ParameterError(
            f"{PARAMETERS} is not set; expected the parameters of config/default.yaml"
        )
    common = {path: _value(tree, path, rule) for path, rule in COMMON_RULES.items()}
    if common["nodes"] > common["particles"]:
        raise ParameterError(
            f"{PARAMETERS}/nodes is {common['nodes']}; expected at most {common['particles']}, "
            f"{PARAMETERS}/particles"
        )
    maps = _map_parameters(tree)
    return NodeParameters(
        particles=common["particles"],
        nodes=common["nodes"],
        seed=common["seed"],
        survey_area=common["survey_area"],
        map_frame=common["frames/map"],
        resampling_timeout_s=common["resampling/timeout_s"],
        map=maps,
        engine_group=_value(tree, maps.engine, group()),
    )


def validate_index(index: Any, nodes: int) -> int:
    """The private parameter ~index."""
    rule = integer(0, nodes - 1)
    if not rule.accepts(index):
        shown = "not set" if index is None else repr(index)
        raise ParameterError(f"~index is {shown}; expected {rule.expected}")
    return index


def _map_parameters(tree: dict[str, Any]) -> MapParameters:
    for unknown in set(_value(tree, "map", group())).difference(MAP_RULES):
        raise ParameterError(
            f"{PARAMETERS}/map/{unknown} is unknown; expected one of {', '.join(MAP_RULES)}"
        )
    return MapParameters(**{key: _value(tree, f"map/{key}", MAP_RULES[key]) for key in MAP_RULES})


def _value(tree: dict[str, Any], path: str, rule: Rule) -> Any:
    value: Any = tree
    for part in path.split("/"):
        value = value.get(part, MISSING) if isinstance(value, dict) else MISSING
    if value is MISSING:
        raise ParameterError(f"{PARAMETERS}/{path} is not set; expected {rule.expected}")
    if not rule.accepts(value):
        raise ParameterError(
            f"{PARAMETERS}/{path} is {value!r}; expected {rule.expected}{_hint(value)}"
        )
    return rule.convert(value)


def _hint(value: Any) -> str:
    """YAML 1.1 takes 1e-4 for text."""
    try:
        float(value if isinstance(value, str) else "")
    except ValueError:
        return ""
    return "; this is text: in YAML write 1.0e-4, not 1e-4, and no quotes"
