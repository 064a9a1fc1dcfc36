"""Engines by their names."""

from __future__ import annotations

import importlib
from typing import Any

from rbpf_svgp_slam.maps.map_group import MapGroup
from rbpf_svgp_slam.maps.seabed_map import SeabedMap
from rbpf_svgp_slam.parameters.engines import ENGINES


def group_class(engine: str) -> type[MapGroup]:
    """The engine's class of groups; only this engine's libraries are imported."""
    if engine not in ENGINES:
        raise ValueError(f"map/engine is {engine!r}; expected one of {', '.join(ENGINES)}")
    module, class_name = ENGINES[engine]
    return getattr(importlib.import_module(module), class_name)


def make_group(parameters: Any) -> MapGroup:
    """From a node's parameters: map.engine, survey_area (frame map, m) and engine_group."""
    chosen = group_class(parameters.map.engine)
    # Here, since it imports numpy.
    from rbpf_svgp_slam.survey_area.polygon import around_origin

    return chosen.from_parameters(parameters.engine_group, around_origin(parameters.survey_area))


def load_map(engine: str, data: bytes) -> SeabedMap:
    """One map with the parameters that it was made with."""
    return group_class(engine).load_saved(data)
