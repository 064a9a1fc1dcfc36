"""A model that is improved in steps which do not depend on the survey's units."""

from __future__ import annotations

import math
from typing import Mapping

import numpy as np
import torch
from torch import Tensor

from rbpf_svgp_slam.svgp.adam import Adam
from rbpf_svgp_slam.svgp.config import SvgpConfig
from rbpf_svgp_slam.svgp.objective import Residuals
from rbpf_svgp_slam.svgp.optimizers.optimizer import fill
from rbpf_svgp_slam.svgp.parameters import FLOORS, Model

#: Adam's rates fall to this share and no lower: the map has to follow new relief all its life.
COOLED_SHARE = 0.1
#: Decay of Adam's averages of the gradients and of their squares. The first averages over twice as
#: many gradients as Adam's default, because those of single minibatches mostly shake the inducing
#: points about: fewer steps are needed. The second forgets squares after a hundred steps, so that
#: steep gradients, early or on new relief, do not slow down what comes after them.
BETAS = (0.95, 0.99)
#: The first o, as a share of the first minibatch's variance.
FIRST_O_SHARE = 0.1


class LearnedModel:
    """Z, ℓ and o by Adam, σ² and c in closed form; one map's own, or shared by a node's maps.

    Adam moves Z in pitches of the initial inducing grid and ℓ and o as logarithms, so that the
    same rates fit an area of 100 m and one of 5 km.
    """

    def __init__(self, config: SvgpConfig, dtype: torch.dtype, device: torch.device) -> None:
        self._config = config
        self.model = Model.zeros(config.inducing_points, dtype, device)
        self._adam = Adam(2 * config.inducing_points + 2, dtype, device, *BETAS)
        #: Spacing of the initial inducing points, m: the unit of their steps.
        self.pitch_m = 1.0
        #: What depths under this model count from, m; NaN before the first step.
        self.reference_m = math.nan
        #: Steps of q(v) taken under it, of all maps that share it.
        self.steps = 0
        #: Another object after every change of the model.
        self.stamp = object()

    @property
    def learns(self) -> bool:
        """There is something to improve."""
        return self._config.learn_inducing_points or self._config.learn_hyperparameters

    def begin(self, y: Tensor) -> None:
        """Take o and σ² from the first depths [M]; before q(v) has learned anything.

        Whatever the height of the relief, the gradients are then of order one. σ² starts as all of
        the depths' variance. o falls as long as there are many more beams than inducing points, and
        starts some way down.
        """
        if self._config.learn_hyperparameters and len(y) > 1:
            variance = y.var(unbiased=False).item()
            lengthscale = self.model.hyperparameters()[0]
            self._set_hyperparameters(lengthscale, FIRST_O_SHARE * variance, variance)
            self.stamp = object()

    def improve(self, gradient: Model, residuals: Residuals, rate: float) -> None:
        """A step along the gradient of a minibatch with these residuals.

        gradient: with respect to ℓ, o and σ² themselves; rate: share of the way that σ² and c go
        towards their best values for the minibatch.
        """
        if self._config.learn_hyperparameters:
            # σ² = misfit/M and c + Σe/M maximise the ELBO: averaged, since minibatches vary
            lengthscale, o, noise = self.model.hyperparameters()
            noise += rate * (residuals.misfit / len(residuals.e) - noise)
            self._set_hyperparameters(lengthscale, o, noise)
            self.model.c.add_(residuals.e.mean(), alpha=rate)
        self._ascend(gradient, residuals)
        self.stamp = object()

    def _ascend(self, gradient: Model, residuals: Residuals) -> None:
        """Adam's step for Z, ℓ and o."""
        config, model, S = self._config, self.model, len(self.model.Z)
        # ∂/∂(Z/pitch)      ∂/∂log ℓ      ∂/∂log o
        step = torch.zeros_like(self._adam.first)
        ascent = torch.cat([gradient.Z.view(-1), gradient.raw[:2]])
        ascent[: 2 * S].mul_(self.pitch_m if config.learn_inducing_points else 0.0)
        learns = float(config.learn_hyperparameters)
        ascent[2 * S] *= residuals.lengthscale * learns
        ascent[2 * S + 1] *= residuals.o * learns
        self._adam.step(step, ascent, self._rates())
        model.Z.view(-1).add_(step[: 2 * S], alpha=self.pitch_m)
        if config.learn_hyperparameters:
            lengthscale, o, noise = model.hyperparameters()
            grow_l, grow_o = step[2 * S :].double().exp().tolist()
            self._set_hyperparameters(lengthscale * grow_l, o * grow_o, noise)

    def _set_hyperparameters(self, *values: float) -> None:
        """Set ℓ, o and σ², kept above their floors."""
        pairs = zip(values, FLOORS)
        self.model.set_hyperparameters(*(max(value, 1.01 * floor) for value, floor in pairs))

    def _rates(self) -> tuple[tuple[int, float], tuple[int, float]]:
        """Rates of Z and of log ℓ and log o: they fall as 1/t, so that q(v) can settle."""
        config = self._config
        cooled = max(COOLED_SHARE, 1.0 / (1.0 + self._adam.steps / config.natgrad_cooling_steps))
        return (
            (2 * len(self.model.Z), cooled * config.natgrad_inducing_rate),
            (2, cooled * config.natgrad_hyperparameter_rate),
        )

    #: Of its state; the names are explained at `NaturalGradient`.
    ENTRIES = {
        "model": ("f", 1),
        "adam_first": ("f", 1),
        "adam_second": ("f", 1),
        "adam_steps": ("i", 0),
        "pitch_m": ("f", 0),
        "model_steps": ("i", 0),
    }

    def arrays(self) -> dict[str, np.ndarray]:
        """Its state, by the names in ENTRIES."""
        return {
            "model": self.model.flat.cpu().numpy(),
            "adam_first": self._adam.first.cpu().numpy(),
            "adam_second": self._adam.second.cpu().numpy(),
            "adam_steps": np.array(self._adam.steps),
            "pitch_m": np.array(self.pitch_m),
            "model_steps": np.array(self.steps),
        }

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Take over what `arrays` returned; raises ValueError if it does not fit."""
        first, second = self._adam.first, self._adam.second
        fill(arrays, model=self.model.flat, adam_first=first, adam_second=second)
        self._adam.steps = arrays["adam_steps"].item()
        self.pitch_m = arrays["pitch_m"].item()
        self.steps = arrays["model_steps"].item()
        self.stamp = object()
