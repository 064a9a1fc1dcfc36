"""Natural gradients for q(v), Adam for the prior (Salimbeni, Eleftheriadis and Hensman 2018)."""

from __future__ import annotations

import math
import threading
from typing import Mapping

import numpy as np
import torch
from torch import Tensor

from rbpf_svgp_slam.svgp import linalg, work_space
from rbpf_svgp_slam.svgp.adam import Adam
from rbpf_svgp_slam.svgp.config import SvgpConfig
from rbpf_svgp_slam.svgp.natural import Moments, Site
from rbpf_svgp_slam.svgp.objective import Objective, Residuals
from rbpf_svgp_slam.svgp.optimizers.optimizer import NotFinite, Optimizer, checked
from rbpf_svgp_slam.svgp.parameters import FLOORS, Model
from rbpf_svgp_slam.svgp.posterior import Gaussian

_thread = threading.local()
#: Adam's rates fall to this share and no lower: the map has to follow new relief all its life.
COOLED_SHARE = 0.1


class NaturalGradient(Optimizer):
    """Every step moves q(v) along its natural gradient, every k-th also the model.

    For a Gaussian likelihood the natural-gradient step is an exponential average of the
    minibatches' sufficient statistics (`Site`); whitening carries q(v) over from one prior to the
    next. σ² and c have their best values in closed form, Z, ℓ and o are left to Adam, in units
    that make its rates independent of the survey's: Z in inducing pitches, ℓ and o as logarithms.

    State: `model` [2S + 4] Z [S, 2], raw ℓ, o, σ² and c; `precision` [S(S + 1)/2] by rows up to
    the diagonal, `shift` and `shift_one` [S] of the site, in double precision; `adam_first` and
    `adam_second` [2S + 2] Adam's moments for Z, ℓ and o, and `adam_steps`; `pitch_m`; `steps`
    taken and `beams_in_log` at the last one.
    """

    ENTRIES = {
        "model": ("f", 1),
        "precision": ("f", 1),
        "shift": ("f", 1),
        "shift_one": ("f", 1),
        "adam_first": ("f", 1),
        "adam_second": ("f", 1),
        "adam_steps": ("i", 0),
        "pitch_m": ("f", 0),
        "steps": ("i", 0),
        "beams_in_log": ("i", 0),
    }

    def __init__(self, config: SvgpConfig) -> None:
        super().__init__(config)
        S = config.inducing_points
        self.model = Model.zeros(S, self.dtype, self.device)
        self.site = Site(S, self.device)
        self._adam = Adam(2 * S + 2, self.dtype, self.device)
        self._steps = 0
        self._beams_in_log = 1

    def step(self, X: Tensor, y: Tensor, N: int) -> float | None:
        config, M = self.config, len(y)
        # What a float32 cannot square would poison the averages for good.
        if not math.isfinite(torch.dot(y, y).item()):
            raise NotFinite(
                f"depths of up to {y.abs().max().item():g} m are not finite when squared"
            )
        objective, buffers = work_space.objective(config, M), self._buffers(M)
        objective.prior.factorise(self.model)
        self.jitter_raises = objective.prior.jitter_raises
        A = objective.project(self.model, X)
        buffers.A.copy_(A)
        G = linalg.gram(buffers.A, buffers.G).div_(M)
        Ay, A_one = torch.mv(buffers.A, y.double()) / M, buffers.A.mean(1)
        _, o, noise = self.model.hyperparameters()
        elbo = None
        if self._steps > 0 and self._steps % config.natgrad_model_period == 0:
            elbo = self._model_step(objective, buffers, y, N)
        rate = max(config.natgrad_rate, 1.0 / (self._steps + 1.0))
        self.site.replace(rate, G, Ay, A_one, o, noise)
        self._steps += 1
        self._beams_in_log = N
        return elbo

    def _model_step(self, objective: Objective, buffers: _Buffers, y: Tensor, N: int) -> float:
        """Improve Z, ℓ, o, σ² and c on the minibatch just projected; the ELBO before that."""
        q = self.site.moments(N, self.model.c.item())
        m = q.m.to(self.dtype)
        buffers.F.copy_(q.F)
        H = linalg.gram_of_transposed_lower(buffers.F, buffers.H).neg_()
        H.diagonal().add_(1.0)
        G = buffers.G_single.copy_(buffers.G).mul_(len(y))
        residuals = objective.residuals(self.model, y, m, G, H)
        elbo = residuals.expected_log_likelihood - q.kl_divergence / N
        objective.model_gradients(m, G, H, residuals, buffers.gradient)
        flat = buffers.gradient.flat
        if not math.isfinite(elbo + torch.dot(flat, flat).item()):
            raise NotFinite(f"ELBO of {elbo:g} nats or its gradient is not finite")
        self._update_model(buffers.gradient, residuals)
        return elbo

    def _update_model(self, gradient: Model, residuals: Residuals) -> None:
        config, model, S = self.config, self.model, len(self.model.Z)
        lengthscale, o, noise = values = model.hyperparameters()
        # ∂/∂(Z/pitch)      ∂/∂log ℓ      ∂/∂log o
        place = torch.zeros(2 * S + 2, dtype=self.dtype, device=self.device)
        ascent = torch.cat([gradient.Z.view(-1), gradient.raw[:2]])
        ascent[: 2 * S].mul_(self.pitch_m if config.learn_inducing_points else 0.0)
        learns = float(config.learn_hyperparameters)
        ascent[2 * S] *= lengthscale * learns
        ascent[2 * S + 1] *= o * learns
        cooled = max(COOLED_SHARE, 1.0 / (1.0 + self._adam.steps / config.natgrad_cooling_steps))
        rates = (
            (2 * S, cooled * config.natgrad_inducing_rate),
            (2, cooled * config.natgrad_hyperparameter_rate),
        )
        self._adam.step(place, ascent, rates)
        model.Z.view(-1).add_(place[: 2 * S], alpha=self.pitch_m)
        if not config.learn_hyperparameters:
            return
        grow_l, grow_o = (math.exp(step) for step in place[2 * S :].tolist())
        # σ² = misfit/M and c + Σe/M maximise the ELBO: averaged, as the minibatches vary
        rate = max(config.natgrad_rate, 1.0 / (self._steps + 1.0))
        noise += rate * (residuals.misfit / len(residuals.e) - noise)
        model.c.add_(residuals.e.mean(), alpha=rate)
        values = lengthscale * grow_l, o * grow_o, noise
        model.set_hyperparameters(
            *(max(value, 1.01 * floor) for value, floor in zip(values, FLOORS))
        )

    def gaussian(self) -> Gaussian:
        q = self._moments()
        return Gaussian.from_inverse_root(q.m.to(self.dtype), q.F.to(self.dtype))

    def _moments(self) -> Moments:
        return self.site.moments(self._beams_in_log, self.model.c.item())

    def arrays(self) -> dict[str, np.ndarray]:
        site, adam, numpy = self.site, self._adam, lambda tensor: tensor.cpu().numpy()
        lower = np.tril_indices(len(site.shift))
        return {
            "model": numpy(self.model.flat),
            "precision": numpy(site.precision)[lower],
            "shift": numpy(site.shift),
            "shift_one": numpy(site.shift_one),
            "adam_first": numpy(adam.first),
            "adam_second": numpy(adam.second),
            "adam_steps": np.array(adam.steps),
            "pitch_m": np.array(self.pitch_m),
            "steps": np.array(self._steps),
            "beams_in_log": np.array(self._beams_in_log),
        }

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        S, site, adam = len(self.site.shift), self.site, self._adam
        for name, vector in (
            ("model", self.model.flat),
            ("shift", site.shift),
            ("shift_one", site.shift_one),
            ("adam_first", adam.first),
            ("adam_second", adam.second),
        ):
            vector.copy_(torch.from_numpy(checked(arrays, name, len(vector))))
        full = np.zeros((S, S))
        full[np.tril_indices(S)] = checked(arrays, "precision", S * (S + 1) // 2)
        site.precision.copy_(torch.from_numpy(full + np.tril(full, -1).T))
        adam.steps = arrays["adam_steps"].item()
        self.pitch_m = arrays["pitch_m"].item()
        self._steps = arrays["steps"].item()
        self._beams_in_log = arrays["beams_in_log"].item()

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
        self.G_single, self.F, self.H = torch.zeros((3, S, S), dtype=dtype, device=device)
        self.gradient = Model.zeros(S, dtype, device)
