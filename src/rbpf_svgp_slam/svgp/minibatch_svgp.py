"""The SVGP that learns from minibatches."""

from __future__ import annotations

import numpy as np

from rbpf_svgp_slam.maps.minibatch_map import MinibatchMap
from rbpf_svgp_slam.svgp.optimizers import GradientAscent, NaturalGradient
from rbpf_svgp_slam.svgp.svgp_map import SvgpMap


class MinibatchSvgp(SvgpMap, MinibatchMap):
    """A map that Adam or natural gradients fit to minibatches.

    In common, with `svgp/shared_hyperparameters`: the `LearnedModel` of all maps of the node.
    """

    OPTIMIZERS = {"adam": GradientAscent, "natgrad": NaturalGradient}
    OTHERS = "a streaming map takes in the log's beams in their order, no minibatches"

    def _make_optimizer(self) -> GradientAscent | NaturalGradient:
        if self.common is not None:
            return NaturalGradient(self.config, self.common)
        return self.OPTIMIZERS[self.config.optimizer](self.config)

    def train_step(self, beams: np.ndarray, beams_in_log: int) -> None:
        if beams_in_log < 1:
            raise ValueError(f"beams_in_log is {beams_in_log}; expected at least 1")
        self._step(
            beams,
            lambda X, y: self.optimizer.step(X, y, beams_in_log),
            self.optimizer.reference_m,
        )
