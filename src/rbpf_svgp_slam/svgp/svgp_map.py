"""The SVGP behind the nodes' map interface."""

from __future__ import annotations

import json
import logging
import math
import threading
from dataclasses import replace

import numpy as np
import torch

from rbpf_svgp_slam.maps.engine import MapEngine
from rbpf_svgp_slam.svgp import state
from rbpf_svgp_slam.svgp.adam import Adam
from rbpf_svgp_slam.svgp.config import SvgpConfig
from rbpf_svgp_slam.svgp.convergence import Convergence
from rbpf_svgp_slam.svgp.inducing import grid_pitch_m, initial_inducing_points
from rbpf_svgp_slam.svgp.linalg import NotPositiveDefinite
from rbpf_svgp_slam.svgp.objective import Objective
from rbpf_svgp_slam.svgp.parameters import Parameters
from rbpf_svgp_slam.svgp.posterior import Posterior

logger = logging.getLogger(__name__)

#: Settings that give the parameters their meaning: a map can only be loaded under the same.
STRUCTURE = ("inducing_points", "kernel", "jitter", "dtype")

_work_space = threading.local()

# numpy looks for the smallest denormal once, and warns where it finds them flushed to zero.
np.finfo(np.float32), np.finfo(np.float64)


class SvgpMap(MapEngine):
    """A map that learns by Adam on the closed-form gradients of the minibatch ELBO.

    Maps of one shape share their work space within a thread, so that a map costs little more
    memory than its parameters and Adam's moments.
    """

    config_class = SvgpConfig

    def __init__(self, config: SvgpConfig, survey_area: np.ndarray) -> None:
        self._allocate(config)
        S, theta = config.inducing_points, self._theta
        theta.Z.copy_(torch.from_numpy(initial_inducing_points(survey_area, S)))
        theta.R.fill_diagonal_(1.0)
        theta.set_hyperparameters(
            config.lengthscale_m or 0.5 * grid_pitch_m(survey_area, S),
            config.outputscale_m2,
            config.noise_std_m**2,
        )

    def _allocate(self, config: SvgpConfig) -> None:
        """Everything but the values of the parameters."""
        if config.device == "cuda" and not torch.cuda.is_available():
            raise ValueError("svgp/device is 'cuda'; expected cpu, torch finds no GPU here")
        self.config = config
        self._dtype = getattr(torch, config.dtype)
        self._device = torch.device(config.device)
        self._theta = Parameters(config.inducing_points, self._dtype, self._device)
        self._adam = Adam(len(self._theta.flat), self._dtype, self._device)
        self._convergence = Convergence(
            config.convergence_decay, config.convergence_window, config.convergence_tolerance
        )
        self._reference_m = math.nan
        self._posterior = None
        self.iterations = 0
        self.skipped_steps = 0
        #: How often Kzz wanted a larger jitter than configured.
        self.jitter_raises = 0

    @property
    def ready(self) -> bool:
        return self._convergence.ready

    @property
    def objective(self) -> float:
        return self._convergence.average

    @property
    def noise_variance_m2(self) -> float:
        return self._theta.hyperparameters()[2]

    @property
    def prior_variance_m2(self) -> float:
        return self._theta.hyperparameters()[1]

    def train_step(self, beams: np.ndarray, beams_in_log: int) -> None:
        beams = _checked(beams, 3, "beams")
        if len(beams) == 0:
            raise ValueError("beams has shape (0, 3); expected at least one beam")
        if beams_in_log < 1:
            raise ValueError(f"beams_in_log is {beams_in_log}; expected at least 1")
        # From the first step on the depths are small numbers, at 10 m of water as at 3000 m.
        reference_m = self._reference_m
        if math.isnan(reference_m):
            reference_m = float(beams[:, 2].mean(dtype=np.float64))
        X = self._tensor(beams[:, :2])
        y = self._tensor(beams[:, 2].astype(np.float64) - reference_m)
        # Denormals, as of the kernel at large distances, take many CPUs far longer than numbers.
        torch.set_flush_denormal(True)
        objective, gradient = self._work_space(len(beams))
        try:
            elbo = objective.evaluate(self._theta, X, y, beams_in_log, gradient)
        except NotPositiveDefinite as error:
            self._skip(str(error))
            return
        self.jitter_raises += objective.jitter_raises
        self._freeze(gradient)
        # Not finite if any element, or its square, which Adam keeps, is not.
        if not math.isfinite(elbo + torch.dot(gradient.flat, gradient.flat).item()):
            self._skip(f"ELBO of {elbo:g} nats or its gradient is not finite")
            return
        self._adam.step(self._theta.flat, gradient.flat, self._rates())
        self._convergence.update(elbo)
        self._reference_m = reference_m
        self._posterior = None
        self.iterations += 1

    def predict(self, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        X = self._tensor(_checked(xy, 2, "xy"))
        if self._posterior is None:
            self._posterior = Posterior(self._theta, self.config.kernel, self.config.jitter)
        mean, variance = (v.cpu().numpy().astype(float) for v in self._posterior.marginals(X))
        reference_m = 0.0 if math.isnan(self._reference_m) else self._reference_m
        return mean + reference_m, variance

    def support_points(self) -> np.ndarray:
        Z = self._theta.Z.cpu().numpy().astype(float)
        return np.column_stack([Z, self.predict(Z)[0]])

    def to_bytes(self) -> bytes:
        pack, convergence = self._theta.pack, self._convergence
        return state.encode(
            {
                "config": json.dumps(self.config.as_dict()),
                "iterations": self.iterations,
                "skipped_steps": self.skipped_steps,
                "jitter_raises": self.jitter_raises,
                "reference_m": self._reference_m,
                "parameters": pack(self._theta.flat),
                "adam_steps": self._adam.steps,
                "adam_first": pack(self._adam.first),
                "adam_second": pack(self._adam.second),
                "averages": np.array(convergence.averages, dtype=float),
                "average_weight": convergence.weight,
                "raw_average": convergence.raw_average,
                "ready": convergence.ready,
            }
        )

    @classmethod
    def from_bytes(cls, data: bytes, config: SvgpConfig | None = None) -> SvgpMap:
        entries = state.decode(data)
        written = _written_config(entries["config"].item())
        config = config or replace(written, device="cpu")
        for name in STRUCTURE:
            theirs, ours = getattr(written, name), getattr(config, name)
            if theirs != ours:
                raise ValueError(f"map was written with svgp/{name} {theirs!r}; expected {ours!r}")
        restored = cls.__new__(cls)
        restored._allocate(config)
        restored._restore(entries)
        return restored

    def _restore(self, entries: dict[str, np.ndarray]) -> None:
        """Take over the entries of a decoded state."""
        theta, adam, convergence = self._theta, self._adam, self._convergence
        for name, vector in (
            ("parameters", theta.flat),
            ("adam_first", adam.first),
            ("adam_second", adam.second),
        ):
            array, size = entries[name], theta.packed_size
            if len(array) != size or not np.isfinite(array).all():
                raise ValueError(f"map's {name} has {len(array)} numbers; expected {size} finite")
            theta.unpack(array, vector)
        adam.steps = entries["adam_steps"].item()
        convergence.averages.extend(entries["averages"].tolist())
        convergence.weight = entries["average_weight"].item()
        convergence.raw_average = entries["raw_average"].item()
        convergence.ready = entries["ready"].item()
        self._reference_m = entries["reference_m"].item()
        self.iterations = entries["iterations"].item()
        self.skipped_steps = entries["skipped_steps"].item()
        self.jitter_raises = entries["jitter_raises"].item()

    def _tensor(self, array: np.ndarray) -> torch.Tensor:
        """In this map's precision, where this map lives."""
        return torch.as_tensor(np.ascontiguousarray(array), dtype=self._dtype, device=self._device)

    def _work_space(self, M: int) -> tuple[Objective, Parameters]:
        """This thread's `Objective` for minibatches of M, and a vector for its gradient."""
        config = self.config
        shape = config.inducing_points, M, config.kernel, config.jitter, self._dtype, self._device
        if getattr(_work_space, "shape", None) != shape:
            _work_space.objective = Objective(*shape)
            _work_space.gradient = Parameters(shape[0], self._dtype, self._device)
            _work_space.shape = shape
        return _work_space.objective, _work_space.gradient

    def _freeze(self, gradient: Parameters) -> None:
        """Take what is not to be learned out of a gradient."""
        if not self.config.learn_inducing_points:
            gradient.Z.zero_()
        if not self.config.learn_hyperparameters:
            gradient.raw.zero_()
            gradient.c.zero_()

    def _rates(self) -> tuple[tuple[int, float], tuple[int, float]]:
        """Learning rates of q(v) and of the model, each with its number of parameters."""
        rate = self.config.learning_rate
        model_rate = self.config.model_learning_rate or rate
        return (len(self._theta.variational), rate), (len(self._theta.model), model_rate)

    def _skip(self, reason: str) -> None:
        """Leave parameters, optimizer and moving average as they were before the step."""
        self.skipped_steps += 1
        logger.warning("training step undone, %d so far: %s", self.skipped_steps, reason)


def _checked(points: np.ndarray, columns: int, name: str) -> np.ndarray:
    """Array [n, columns] of finite numbers."""
    points = np.asarray(points)
    if points.ndim != 2 or points.shape[1] != columns:
        raise ValueError(f"{name} has shape {points.shape}; expected [n, {columns}]")
    bad = np.count_nonzero(~np.isfinite(points).all(axis=1))
    if bad:
        raise ValueError(f"{bad} of {len(points)} {name} are not finite; expected none")
    return points


def _written_config(text: str) -> SvgpConfig:
    try:
        return SvgpConfig(**json.loads(text))
    except (TypeError, ValueError) as error:
        raise ValueError(f"map's config is not that of an SVGP ({error})") from error
