"""Engines by name, and the factory that makes and restores the maps of one node."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np

from rbpf_svgp_slam.maps.engine import MapEngine
from rbpf_svgp_slam.parameters.engines import ENGINES
from rbpf_svgp_slam.survey_area.polygon import survey_origin


def make_engine_class(name: str) -> type[MapEngine]:
    """The engine's class; only this engine's libraries are imported."""
    if name not in ENGINES:
        raise ValueError(f"map/engine is {name!r}; expected one of {', '.join(ENGINES)}")
    module, class_name = ENGINES[name]
    return getattr(importlib.import_module(module), class_name)


class MapFactory:
    """Makes equal maps and restores copies of them."""

    def __init__(self, engine: str, config: Any, survey_area: np.ndarray) -> None:
        """survey_area: polygon [V, 2] relative to the survey origin, m."""
        self._engine_class = make_engine_class(engine)
        self._config = config
        self._survey_area = survey_area
        self._group = self._engine_class.make_group(config, survey_area)
        #: Beams that one training step of a map wants.
        self.minibatch_size: int = config.minibatch_size

    @property
    def teacher(self) -> MapEngine | None:
        """The map that learns for this node's, if they take in every beam once."""
        return getattr(self._group, "teacher", None)

    @property
    def rebuild_beams(self) -> int:
        """Largest sample of beams that a map's `rebuild` wants."""
        return self._config.streaming_rebuild_beams

    def create(self) -> MapEngine:
        """A new map of this node; all are equal."""
        return self._engine_class(self._config, self._survey_area, self._group)

    def load(self, data: bytes) -> MapEngine:
        """The map that wrote the bytes, as one of this node's."""
        return self._engine_class.from_bytes(data, self._config, self._group)

    def load_alone(self, data: bytes) -> MapEngine:
        """The map that wrote the bytes, independent of all others."""
        return self._engine_class.from_bytes(data, self._config)


def make_factory(parameters: Any) -> MapFactory:
    """From a node's parameters: map.engine, survey_area (frame map, m) and engine_group."""
    engine = parameters.map.engine
    config = make_engine_class(engine).config_class.from_parameters(parameters.engine_group)
    vertices = np.asarray(parameters.survey_area, dtype=float)
    return MapFactory(engine, config, vertices - survey_origin(vertices))


def load_map(engine: str, data: bytes) -> MapEngine:
    """One map with the settings that it was trained with."""
    return make_engine_class(engine).from_bytes(data)
