"""The SVGP behind the nodes' map interface."""

from __future__ import annotations

import json
import logging
import math
from dataclasses import replace

import numpy as np
import torch

from rbpf_svgp_slam.maps.engine import MapEngine
from rbpf_svgp_slam.svgp import state
from rbpf_svgp_slam.svgp.config import SvgpConfig
from rbpf_svgp_slam.svgp.convergence import Convergence
from rbpf_svgp_slam.svgp.inducing import grid_pitch_m, initial_inducing_points
from rbpf_svgp_slam.svgp.linalg import NotPositiveDefinite
from rbpf_svgp_slam.svgp.optimizers import OPTIMIZERS
from rbpf_svgp_slam.svgp.optimizers.optimizer import NotFinite
from rbpf_svgp_slam.svgp.posterior import Posterior

logger = logging.getLogger(__name__)

#: Settings that give the parameters their meaning: a map can only be loaded under the same.
STRUCTURE = ("inducing_points", "kernel", "jitter", "dtype", "optimizer")

# numpy looks for the smallest denormal once, and warns where it finds them flushed to zero.
np.finfo(np.float32), np.finfo(np.float64)


class SvgpMap(MapEngine):
    """A map that one of `OPTIMIZERS` fits to the minibatches it is given.

    Maps of one shape share their work space within a thread, so that a map costs little more
    memory than its parameters and its optimizer's state.
    """

    config_class = SvgpConfig

    def __init__(self, config: SvgpConfig, survey_area: np.ndarray) -> None:
        self._allocate(config)
        S, model = config.inducing_points, self._optimizer.model
        pitch_m = grid_pitch_m(survey_area, S)
        model.Z.copy_(torch.from_numpy(initial_inducing_points(survey_area, S)))
        model.set_hyperparameters(
            config.lengthscale_m or 0.5 * pitch_m, config.outputscale_m2, config.noise_std_m**2
        )
        self._optimizer.pitch_m = pitch_m

    def _allocate(self, config: SvgpConfig) -> None:
        """Everything but the values of the parameters."""
        if config.device == "cuda" and not torch.cuda.is_available():
            raise ValueError("svgp/device is 'cuda'; expected cpu, torch finds no GPU here")
        self.config = config
        self._optimizer = OPTIMIZERS[config.optimizer](config)
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
        return self._optimizer.model.hyperparameters()[2]

    @property
    def prior_variance_m2(self) -> float:
        return self._optimizer.model.hyperparameters()[1]

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
        try:
            elbo = self._optimizer.step(X, y, beams_in_log)
        except (NotFinite, NotPositiveDefinite) as error:
            self.skipped_steps += 1
            logger.warning("training step undone, %d so far: %s", self.skipped_steps, error)
            return
        self.jitter_raises += self._optimizer.jitter_raises
        if elbo is not None:
            self._convergence.update(elbo)
        self._reference_m = reference_m
        self._posterior = None
        self.iterations += 1

    def predict(self, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        X = self._tensor(_checked(xy, 2, "xy"))
        if self._posterior is None:
            optimizer, config = self._optimizer, self.config
            self._posterior = Posterior(
                optimizer.model, optimizer.gaussian(), config.kernel, config.jitter
            )
        mean, variance = (v.cpu().numpy().astype(float) for v in self._posterior.marginals(X))
        reference_m = 0.0 if math.isnan(self._reference_m) else self._reference_m
        return mean + reference_m, variance

    def support_points(self) -> np.ndarray:
        Z = self._optimizer.model.Z.cpu().numpy().astype(float)
        return np.column_stack([Z, self.predict(Z)[0]])

    def to_bytes(self) -> bytes:
        convergence = self._convergence
        return state.encode(
            {
                "config": json.dumps(self.config.as_dict()),
                "iterations": self.iterations,
                "skipped_steps": self.skipped_steps,
                "jitter_raises": self.jitter_raises,
                "reference_m": self._reference_m,
                "averages": np.array(convergence.averages, dtype=float),
                "average_weight": convergence.weight,
                "raw_average": convergence.raw_average,
                "ready": convergence.ready,
                **self._optimizer.arrays(),
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
        convergence = self._convergence
        state.expect_entries(entries, self._optimizer.ENTRIES)
        self._optimizer.restore(entries)
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
        optimizer, contiguous = self._optimizer, np.ascontiguousarray(array)
        return torch.as_tensor(contiguous, dtype=optimizer.dtype, device=optimizer.device)


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
