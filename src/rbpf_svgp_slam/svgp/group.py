"""What the SVGP maps of one node have in common."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import torch

from rbpf_svgp_slam.svgp.config import SvgpConfig
from rbpf_svgp_slam.svgp.optimizers import OPTIMIZERS, NaturalGradient
from rbpf_svgp_slam.svgp.optimizers.learned_model import LearnedModel
from rbpf_svgp_slam.svgp.optimizers.optimizer import Optimizer
from rbpf_svgp_slam.svgp.optimizers.streaming import FixedModel
from rbpf_svgp_slam.svgp.parameters import Model

if TYPE_CHECKING:
    from rbpf_svgp_slam.svgp.svgp_map import SvgpMap


class SvgpGroup:
    """Nothing, unless the maps share their model or have a teacher."""

    def __init__(self, shared: LearnedModel | None = None, teacher: SvgpMap | None = None) -> None:
        #: The model of all maps, with `svgp/shared_hyperparameters`.
        self.shared = shared
        #: The map that learns the model for streaming maps, which take in every beam once.
        self.teacher = teacher
        self._model: FixedModel | None = None
        self._compared: object = None  # stamp of the teacher's model when they were last compared

    @classmethod
    def for_node(cls, config: SvgpConfig, teacher: SvgpMap | None) -> SvgpGroup:
        """The group that the settings ask for; teacher: for streaming maps."""
        shared = None
        if config.shared_hyperparameters:
            device = torch.device(config.device)
            shared = LearnedModel(config, getattr(torch, config.dtype), device)
        return cls(shared, teacher)

    def model(self) -> FixedModel:
        """The teacher's model, as it was when it last had moved by more than the tolerance."""
        optimizer, config = self.teacher._optimizer, self.teacher.config
        if self._compared is optimizer.stamp:
            return self._model
        self._compared = optimizer.stamp
        model, pitch_m = optimizer.model, optimizer.pitch_m
        if self._model is None or (
            distance(self._model.model, model, pitch_m) > config.streaming_tolerance
        ):
            self._model = FixedModel(config, model.flat)
        return self._model

    def welcome(self, optimizer: Optimizer) -> None:
        """Let a streaming map that was restored share what it has in common with the others."""
        if self.teacher is not None and torch.equal(
            optimizer.fixed.model.flat, self.model().model.flat
        ):
            optimizer.fixed = self.model()


def make_optimizer(config: SvgpConfig, group: SvgpGroup) -> Optimizer:
    """The optimizer of a map of this group."""
    if group.shared is not None:
        return NaturalGradient(config, group.shared)
    return OPTIMIZERS[config.optimizer](config)


def distance(one: Model, other: Model, pitch_m: float) -> float:
    """The largest of: RMS move of Z in pitches, change of c in √o, of ℓ, o, σ² as logarithms."""
    squares = (one.Z - other.Z).square().sum(1).mean().item()
    values, others = one.hyperparameters(), other.hyperparameters()
    logs = [abs(math.log(a / b)) for a, b in zip(values, others)]
    shift = abs((one.c - other.c).item()) / math.sqrt(others[1])
    return max(math.sqrt(squares) / pitch_m, shift, *logs)
