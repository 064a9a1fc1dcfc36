"""The SVGP maps of one node."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Mapping

import numpy as np
import torch

from rbpf_svgp_slam.maps.map_group import MapGroup
from rbpf_svgp_slam.svgp import state
from rbpf_svgp_slam.svgp.config import SvgpConfig
from rbpf_svgp_slam.svgp.minibatch_svgp import MinibatchSvgp
from rbpf_svgp_slam.svgp.optimizers.learned_model import LearnedModel
from rbpf_svgp_slam.svgp.streaming_svgp import StreamingSvgp
from rbpf_svgp_slam.svgp.svgp_map import SvgpMap
from rbpf_svgp_slam.svgp.taught_model import TaughtModel


class SvgpGroup(MapGroup):
    """Maps under `svgp/optimizer`; what they have in common depends on it.

    streaming: a teacher, which learns the model by natgrad. natgrad with
    `svgp/shared_hyperparameters`: one model. Otherwise nothing.
    """

    def __init__(self, config: SvgpConfig, survey_area: np.ndarray) -> None:
        """survey_area: polygon [V, 2] relative to the survey origin, m."""
        self.config = config
        self.map_class = svgp_class(config)
        self.minibatch_size = config.minibatch_size
        self.rebuild_beams = config.streaming_rebuild_beams
        self._survey_area = survey_area
        self._common: LearnedModel | TaughtModel | None = None
        if self.map_class is StreamingSvgp:
            self.teacher = MinibatchSvgp(replace(config, optimizer="natgrad"), survey_area)
            self._common = TaughtModel(self.teacher, config.streaming_tolerance)
        elif config.shared_hyperparameters:
            dtype, device = getattr(torch, config.dtype), torch.device(config.device)
            self._common = LearnedModel(config, dtype, device)

    @classmethod
    def from_parameters(cls, parameters: Mapping[str, Any], survey_area: np.ndarray) -> SvgpGroup:
        return cls(SvgpConfig.from_parameters(parameters), survey_area)

    def create(self) -> SvgpMap:
        return self.map_class(self.config, self._survey_area, self._common)

    def create_anew(self) -> SvgpMap:
        one = self.create()
        one.begin_anew()
        return one

    def load(self, data: bytes) -> SvgpMap:
        return self.map_class.from_bytes(data, self.config, self._common)

    def load_alone(self, data: bytes) -> SvgpMap:
        """As `load_saved`, but on this node's device."""
        return self.map_class.from_bytes(data, self.config)

    @classmethod
    def load_saved(cls, data: bytes) -> SvgpMap:
        entries = state.decode(data)
        return svgp_class(state.written_config(entries)).from_entries(entries)


def svgp_class(config: SvgpConfig) -> type[MinibatchSvgp] | type[StreamingSvgp]:
    """The kind of map that a configuration asks for."""
    return StreamingSvgp if config.optimizer in StreamingSvgp.OPTIMIZERS else MinibatchSvgp
