"""Natural gradients for q(v), Adam for the prior (Salimbeni, Eleftheriadis and Hensman 2018)."""

from __future__ import annotations

import math
import threading
from typing import Mapping

import numpy as np
import torch
from torch import Tensor

from rbpf_svgp_slam.svgp import linalg, work_space
from rbpf_svgp_slam.svgp.config import SvgpConfig
from rbpf_svgp_slam.svgp.kernels import Correlation
from rbpf_svgp_slam.svgp.natural import Site
from rbpf_svgp_slam.svgp.objective import Objective, elbo
from rbpf_svgp_slam.svgp.optimizers.learned_model import LearnedModel
from rbpf_svgp_slam.svgp.optimizers.optimizer import (
    MinibatchOptimizer,
    NotFinite,
    checked,
    expect_squares,
    fill,
    packed,
    unpack,
)
from rbpf_svgp_slam.svgp.parameters import Model
from rbpf_svgp_slam.svgp.posterior import Gaussian
from rbpf_svgp_slam.svgp.prior import Prior

_thread = threading.local()


class NaturalGradient(MinibatchOptimizer):
    """Every step moves q(v) along its natural gradient, every k-th also improves the model.

    For a Gaussian likelihood the natural-gradient step is an exponential average of the
    minibatches' sufficient statistics (`Site`); whitening carries q(v) over from one model to the
    next. The model may be shared with the node's other maps.

    State: `model` [2S + 4] Z [S, 2], raw ℓ, o, σ² and c; `adam_first` and `adam_second` [2S + 2]
    Adam's moments for Z, ℓ and o, and `adam_steps`; `pitch_m`; `model_steps` of q(v) under this
    model; `precision` [S(S + 1)/2] by rows up to the diagonal, `shift` and `shift_one` [S] of the
    site, in double precision; `steps` taken by this map and `beams_in_log` at the last one.
    """

    ENTRIES = {
        **LearnedModel.ENTRIES,
        "precision": ("f", 1),
        "shift": ("f", 1),
        "shift_one": ("f", 1),
        "steps": ("i", 0),
        "beams_in_log": ("i", 0),
    }

    def __init__(self, config: SvgpConfig, shared: LearnedModel | None = None) -> None:
        super().__init__(config)
        self._shares = shared is not None
        self._learned = shared or LearnedModel(config, self.dtype, self.device)
        self.site = Site(config.inducing_points, self.device)
        self._steps = 0
        self._beams_in_log = 1

    @property
    def model(self) -> Model:
        return self._learned.model

    @property
    def stamp(self) -> object:
        return self._learned.stamp

    @property
    def reference_m(self) -> float:
        """What depths count from, m: the model's c is an offset to it, and shared with it."""
        return self._learned.reference_m

    @reference_m.setter
    def reference_m(self, reference_m: float) -> None:
        self._learned.reference_m = reference_m

    @property
    def pitch_m(self) -> float:
        """Spacing of the initial inducing points, m."""
        return self._learned.pitch_m

    def start(self, Z: np.ndarray, lengthscale_m: float, pitch_m: float) -> None:
        if self._learned.steps == 0:
            self._start(self.model, Z, lengthscale_m)
            self._learned.pitch_m = pitch_m

    def step(self, X: Tensor, y: Tensor, N: int) -> float | None:
        M, learned = len(y), self._learned
        expect_squares(y)
        if learned.steps == 0:
            learned.begin(y)
        objective, buffers = work_space.objective(self.config, M), self._buffers(M)
        objective.prior.factorise(self.model, learned.stamp)
        self.jitter_raises = objective.prior.jitter_raises
        buffers.A.copy_(objective.project(self.model, X))
        G = linalg.gram(buffers.A, buffers.G).div_(M)
        Ay, A_one = torch.mv(buffers.A, y.double()).div_(M), buffers.A.mean(1)
        _, o, noise = self.model.hyperparameters()
        rate = max(self.config.natgrad_rate, 1.0 / (self._steps + 1.0))
        bound = None
        if self._steps > 0 and learned.steps % self.config.natgrad_model_period == 0:
            bound = self._model_step(objective, buffers, y, N, rate)
        self.site.replace(rate, G, Ay, A_one, o, noise)
        self._steps += 1
        learned.steps += 1
        self._beams_in_log = N
        return bound

    def _model_step(
        self, objective: Objective, buffers: _Buffers, y: Tensor, N: int, rate: float
    ) -> float:
        """Improve the model on the minibatch just projected; returns the ELBO before that."""
        q = self.site.moments(N, self.model.c.item(), self.dtype)
        m = q.m.to(self.dtype)
        H = linalg.gram_of_transposed_lower(q.F, buffers.H).neg_()
        H.diagonal().add_(1.0)
        G = buffers.G_single.copy_(buffers.G).mul_(len(y))
        residuals = objective.residuals(self.model, y, m, G, H)
        bound = elbo(residuals, q, N)
        flat = buffers.gradient.flat.zero_()
        if self._learned.learns:
            objective.model_gradients(m, G, H, residuals, buffers.gradient)
        if not math.isfinite(bound + torch.dot(flat, flat).item()):
            raise NotFinite(f"ELBO of {bound:g} nats or its gradient is not finite")
        if self._learned.learns:
            self._learned.improve(buffers.gradient, residuals, rate)
        return bound

    def gaussian(self) -> Gaussian:
        q = self.site.moments(self._beams_in_log, self.model.c.item(), self.dtype)
        return Gaussian.from_inverse_root(q.m.to(self.dtype), q.F)

    def _shared(self) -> list[object]:
        return [self.config, self._learned] if self._shares else [self.config]

    def arrays(self) -> dict[str, np.ndarray]:
        return {
            **self._learned.arrays(),
            "precision": packed(self.site.precision),
            "shift": self.site.shift.cpu().numpy(),
            "shift_one": self.site.shift_one.cpu().numpy(),
            "steps": np.array(self._steps),
            "beams_in_log": np.array(self._beams_in_log),
        }

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """The first map of a node that shares its model brings it along; others adapt to it."""
        S, site = len(self.site.shift), self.site
        fill(arrays, shift=site.shift, shift_one=site.shift_one)
        unpack(checked(arrays, "precision", S * (S + 1) // 2), site.precision)
        self._steps = arrays["steps"].item()
        self._beams_in_log = arrays["beams_in_log"].item()
        if self._shares and self._learned.steps > 0:
            self._adapt_from(Model(torch.from_numpy(checked(arrays, "model", 2 * S + 4))))
        else:
            self._learned.restore(arrays)

    def restore_reference(self, reference_m: float) -> None:
        if math.isnan(self.reference_m):
            self.reference_m = reference_m
        elif not math.isnan(reference_m):
            self.site.move_reference(reference_m - self.reference_m)

    def _adapt_from(self, old: Model) -> None:
        """Express what was learned under another model, `old`, under this one."""
        new, config = self.model, self.config
        old, new = (Model(model.flat.to(self.device, torch.float64)) for model in (old, new))
        args = (config.inducing_points, config.kernel, config.jitter, torch.float64, self.device)
        old_inverse, new_inverse = Prior(*args).factorise(old), Prior(*args).factorise(new)
        # f(x) ≈ ρ(x, Z) ρ(Z, Z)⁻¹ f(Z) under the old model, so that with Z', L' of the new one
        # L'⁻¹ρ'(Z', x) ≈ T·L⁻¹ρ(Z, x)        T = L'⁻¹ ρ'(Z', Z) L⁻ᵀ
        S, (lengthscale, o, noise) = config.inducing_points, new.hyperparameters()
        correlation = Correlation(config.kernel, (S, S), torch.float64, self.device)
        T = new_inverse @ correlation.evaluate(new.Z, old.Z, lengthscale) @ old_inverse.T
        _, old_o, old_noise = old.hyperparameters()
        factor = o / noise / (old_o / old_noise)
        self.site.transport(T, factor, factor * math.sqrt(old_o / o))

    def _buffers(self, M: int) -> _Buffers:
        """This thread's work space for minibatches of M; maps share it."""
        key = (self.config.inducing_points, M, self.dtype, self.device)
        if getattr(_thread, "key", None) != key:
            _thread.buffers = _Buffers(*key)
            _thread.key = key
        return _thread.buffers


class _Buffers:
    """Work space of a step."""

    def __init__(self, S: int, M: int, dtype: torch.dtype, device: torch.device) -> None:
        double = torch.float64
        self.A = torch.empty((S, M), dtype=double, device=device)
        self.G = torch.empty((S, S), dtype=double, device=device)
        self.G_single, self.H = torch.zeros((2, S, S), dtype=dtype, device=device)
        self.gradient = Model.zeros(S, dtype, device)
