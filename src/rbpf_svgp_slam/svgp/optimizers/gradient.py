"""Gradient ascent on everything by Adam, `svgp/optimizer: adam`: the paper's optimizer."""

from __future__ import annotations

import math
import threading
from typing import Mapping

import numpy as np
import torch
from torch import Tensor

from rbpf_svgp_slam.svgp import work_space
from rbpf_svgp_slam.svgp.adam import Adam
from rbpf_svgp_slam.svgp.config import SvgpConfig
from rbpf_svgp_slam.svgp.optimizers.optimizer import MinibatchOptimizer, NotFinite, checked
from rbpf_svgp_slam.svgp.parameters import Model, Parameters
from rbpf_svgp_slam.svgp.posterior import Gaussian

_thread = threading.local()


class GradientAscent(MinibatchOptimizer):
    """Adam's steps on m, R, Z, ℓ, o, σ² and c along the gradient of the minibatch ELBO.

    State: `parameters`, `adam_first` and `adam_second` [P], P = S + S(S + 1)/2 + 2S + 4: m [S],
    R [S, S] by rows up to the diagonal, Z [S, 2], raw ℓ, o, σ² and c, and Adam's two moments of
    them; `adam_steps`.
    """

    ENTRIES = {
        "parameters": ("f", 1),
        "adam_first": ("f", 1),
        "adam_second": ("f", 1),
        "adam_steps": ("i", 0),
    }

    def __init__(self, config: SvgpConfig) -> None:
        super().__init__(config)
        self.theta = Parameters(config.inducing_points, self.dtype, self.device)
        self.theta.R.fill_diagonal_(1.0)
        self._adam = Adam(len(self.theta.flat), self.dtype, self.device)

    @property
    def model(self) -> Model:
        return self.theta

    def start(self, Z: np.ndarray, lengthscale_m: float, pitch_m: float) -> None:
        self._start(self.theta, Z, lengthscale_m)

    def step(self, X: Tensor, y: Tensor, N: int) -> float:
        objective, gradient = work_space.objective(self.config, len(y)), self._gradient()
        elbo = objective.evaluate(self.theta, X, y, N, gradient)
        self.jitter_raises = objective.prior.jitter_raises
        self._mask(gradient)
        # This sum is not finite if any element is not, or its square, which Adam keeps.
        if not math.isfinite(elbo + torch.dot(gradient.flat, gradient.flat).item()):
            raise NotFinite(f"ELBO of {elbo:g} nats or its gradient is not finite")
        rates = [(len(gradient.flat), self.config.learning_rate)]
        self._adam.step(self.theta.flat, gradient.flat, rates)
        return elbo

    def gaussian(self) -> Gaussian:
        return Gaussian.from_root(self.theta.m, self.theta.R)

    def arrays(self) -> dict[str, np.ndarray]:
        pack, adam = self.theta.pack, self._adam
        return {
            "parameters": pack(self.theta.flat),
            "adam_first": pack(adam.first),
            "adam_second": pack(adam.second),
            "adam_steps": np.array(adam.steps),
        }

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        theta, adam = self.theta, self._adam
        for name, vector in (
            ("parameters", theta.flat),
            ("adam_first", adam.first),
            ("adam_second", adam.second),
        ):
            theta.unpack(checked(arrays, name, theta.packed_size), vector)
        adam.steps = arrays["adam_steps"].item()

    def _gradient(self) -> Parameters:
        """This thread's vector for gradients of this size; maps share it."""
        key = (len(self.theta.flat), self.dtype, self.device)
        if getattr(_thread, "key", None) != key:
            _thread.gradient = Parameters(len(self.theta.m), self.dtype, self.device)
            _thread.key = key
        return _thread.gradient

    def _mask(self, gradient: Parameters) -> None:
        """Set the gradient of what is not to be learned to zero."""
        if not self.config.learn_inducing_points:
            gradient.Z.zero_()
        if not self.config.learn_hyperparameters:
            gradient.raw.zero_()
            gradient.c.zero_()
