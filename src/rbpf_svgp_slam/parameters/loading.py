"""Validates the parameters of the Python nodes: map nodes, their launcher and the recorder.

The core checks the values that only it uses; every name is checked here too. Nothing is imported
here that starts a numerical library: the number of threads, a parameter, must be known before.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Mapping, TypeVar

from rbpf_svgp_slam.nested import flatten
from rbpf_svgp_slam.parameters.engines import ENGINES
from rbpf_svgp_slam.parameters.known import complaints, default_parameters
from rbpf_svgp_slam.parameters.rules import (
    MISSING,
    ParameterError,
    Polygon,
    Rule,
    absolute_path,
    between,
    checked,
    choice,
    epsg_code,
    group,
    integer,
    name,
    of_type,
    place,
    polygon,
)
from rbpf_svgp_slam.protocol.names import PARAMETERS

Group = TypeVar("Group")


@dataclass(frozen=True)
class FrameParameters:
    """Of group `frames`."""

    map: str


@dataclass(frozen=True)
class MapParameters:
    """Group `map`."""

    engine: str
    threads: int
    resolution_m: float
    publish_period_s: float


@dataclass(frozen=True)
class OutputParameters:
    """Of group `output`."""

    final_training_s: float
    publish_rate_hz: float
    figures: bool
    time_lapse_period_s: float


@dataclass(frozen=True)
class NodeParameters:
    """Everything that the Python nodes are configured with."""

    particles: int
    nodes: int
    seed: int
    survey_area: Polygon  # vertices (x, y), frame map, m
    survey_origin: tuple[float, ...]  # latitude, longitude of map's origin, degrees; empty: none
    survey_epsg: int  # of the products' CRS; 0: the UTM zone of the origin
    resampling_timeout_s: float
    frames: FrameParameters
    map: MapParameters
    output: OutputParameters
    engine_group: dict[str, Any]  # named by map.engine, for the engine's settings to check


@dataclass(frozen=True)
class RecorderParameters:
    """Private parameters of the recorder."""

    out_dir: Path  # the run folder
    bag: str  # being replayed; empty: live
    offline: bool  # the bag is read by rbpf_offline, not played
    terrain_file: str  # the true seabed of a simulated survey; empty: not known
    overwrite: bool  # an earlier run in the folder is lost; otherwise it is refused
    resume: bool  # the survey in the folder goes on


#: Of map.npz and the report's pictures: what memory and patience bear.
MOST_CELLS = 25_000_000

RULES = {
    "particles": integer(1, 100_000),
    "nodes": integer(1, 1000),
    "seed": integer(0, 2**31 - 1),
    "survey_area": polygon(),
    "survey_origin": place(),
    "survey_epsg": epsg_code(),
    "frames/map": name(),
    "resampling/timeout_s": between(0.1, 1e10),
    "map/threads": integer(1, 256),
    "map/resolution_m": between(0.001, 1e7),
    "map/publish_period_s": between(0.0, 1e10),
    "output/final_training_s": between(0.0, 1e10),
    "output/publish_rate_hz": between(0.01, 100.0),
    "output/figures": of_type(bool),
    "output/time_lapse_period_s": between(0.0, 1e10),
}
RECORDER_RULES = {
    "out": absolute_path("of the run folder"),
    "bag": of_type(str),
    "offline": of_type(bool),
    "terrain": of_type(str),
    "overwrite": of_type(bool),
    "resume": of_type(bool),
}


def validate(tree: dict[str, Any]) -> NodeParameters:
    """The parameters from the tree below `rbpf_svgp_slam/`; raises ParameterError."""
    if not isinstance(tree, dict) or not tree:
        raise ParameterError(
            f"{PARAMETERS} is not set; expected the parameters of config/default.yaml"
        )
    _refuse_unknown(tree)
    particles, nodes = _value(tree, "particles"), _value(tree, "nodes")
    if nodes > particles:
        raise ParameterError(
            f"{PARAMETERS}/nodes is {nodes}; expected at most {particles}, {PARAMETERS}/particles"
        )
    map_parameters = _group(tree, "map", MapParameters)
    _expect_few_cells(_value(tree, "survey_area"), map_parameters.resolution_m)
    return NodeParameters(
        particles=particles,
        nodes=nodes,
        seed=_value(tree, "seed"),
        survey_area=_value(tree, "survey_area"),
        survey_origin=_value(tree, "survey_origin"),
        survey_epsg=_value(tree, "survey_epsg"),
        resampling_timeout_s=_value(tree, "resampling/timeout_s"),
        frames=_group(tree, "frames", FrameParameters),
        map=map_parameters,
        output=_group(tree, "output", OutputParameters),
        engine_group=_value(tree, map_parameters.engine, group()),
    )


def validate_index(index: Any, nodes: int) -> int:
    """The private parameter ~index of a map node; none: not set."""
    return checked("~index", MISSING if index is None else index, integer(0, nodes - 1))


def validate_recorder(private: Mapping[str, Any]) -> RecorderParameters:
    """The recorder's private parameters, by name without ~; raises ParameterError."""
    defaults = {"bag": "", "offline": False, "terrain": "", "overwrite": False, "resume": False}
    given = {"out": MISSING, **defaults, **private}
    values = {key: checked(f"~{key}", given[key], rule) for key, rule in RECORDER_RULES.items()}
    return RecorderParameters(
        out_dir=Path(values["out"]).expanduser(),
        bag=values["bag"],
        offline=values["offline"],
        terrain_file=values["terrain"],
        overwrite=values["overwrite"],
        resume=values["resume"],
    )


def _refuse_unknown(tree: dict[str, Any]) -> None:
    known = default_parameters()
    # An engine that comes from elsewhere may have a group that is not in config/default.yaml.
    engine = dict(flatten(tree)).get("map/engine")
    ours = {key: value for key, value in tree.items() if key in known or key != engine}
    for complaint in complaints(ours, known):
        raise ParameterError(f"{PARAMETERS}/{complaint}")


def _expect_few_cells(area: Polygon, resolution_m: float) -> None:
    """Of the grid over the polygon's bounding box."""
    width_m, height_m = (max(axis) - min(axis) for axis in zip(*area))
    cells = width_m / resolution_m * (height_m / resolution_m)
    if cells > MOST_CELLS:
        raise ParameterError(
            f"{PARAMETERS}/map/resolution_m is {resolution_m:g}, which divides the "
            f"{width_m:g} m x {height_m:g} m of {PARAMETERS}/survey_area into {cells:.3g} cells; "
            f"expected at most {MOST_CELLS:,}"
        )


def _group(tree: dict[str, Any], path: str, kind: type[Group]) -> Group:
    _value(tree, path, group())
    return kind(**{field.name: _value(tree, f"{path}/{field.name}") for field in fields(kind)})


def _value(tree: dict[str, Any], path: str, rule: Rule | None = None) -> Any:
    value: Any = tree
    for part in path.split("/"):
        value = value.get(part, MISSING) if isinstance(value, dict) else MISSING
    return checked(f"{PARAMETERS}/{path}", value, rule or _rule(path))


def _rule(path: str) -> Rule:
    # An engine may be registered after this module was loaded.
    return choice(*ENGINES) if path == "map/engine" else RULES[path]
