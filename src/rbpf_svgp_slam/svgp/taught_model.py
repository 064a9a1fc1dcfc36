"""What streaming maps take over from the map that learns for them."""

from __future__ import annotations

import math

from rbpf_svgp_slam.svgp.minibatch_svgp import MinibatchSvgp
from rbpf_svgp_slam.svgp.optimizers.streaming import FixedModel
from rbpf_svgp_slam.svgp.parameters import Model


class TaughtModel:
    """The teacher's model as it was when it last had moved by more than a tolerance."""

    def __init__(self, teacher: MinibatchSvgp, tolerance: float) -> None:
        """teacher: a natgrad map; tolerance: see `distance`."""
        self.teacher = teacher
        self._tolerance = tolerance
        self._latest: FixedModel | None = None
        self._compared: object = None  # stamp of the teacher's model when they were last compared

    def latest(self) -> FixedModel:
        """The same object until the teacher has moved on."""
        learner = self.teacher.optimizer
        if self._compared is learner.stamp:
            return self._latest
        self._compared = learner.stamp
        if self._latest is None or (
            distance(self._latest.model, learner.model, learner.pitch_m) > self._tolerance
        ):
            self._latest = FixedModel(self.teacher.config, learner.model.flat)
        return self._latest


def distance(one: Model, other: Model, pitch_m: float) -> float:
    """The largest of: RMS move of Z in pitches, change of c in √o, of ℓ, o, σ² as logarithms."""
    squares = (one.Z - other.Z).square().sum(1).mean().item()
    values, others = one.hyperparameters(), other.hyperparameters()
    logs = [abs(math.log(a / b)) for a, b in zip(values, others)]
    shift = abs((one.c - other.c).item()) / math.sqrt(others[1])
    return max(math.sqrt(squares) / pitch_m, shift, *logs)
