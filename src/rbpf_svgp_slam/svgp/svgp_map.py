"""What the two kinds of SVGP maps have in common: steps, predictions, and bytes."""

from __future__ import annotations

import copy
import json
import logging
import math
from abc import abstractmethod
from dataclasses import replace
from typing import Any, Callable, ClassVar, Mapping

import numpy as np
import torch

from rbpf_svgp_slam.maps.seabed_map import SeabedMap
from rbpf_svgp_slam.svgp import state
from rbpf_svgp_slam.svgp.config import SvgpConfig
from rbpf_svgp_slam.svgp.convergence import Convergence
from rbpf_svgp_slam.svgp.inducing import grid_pitch_m, initial_inducing_points
from rbpf_svgp_slam.svgp.linalg import NotPositiveDefinite
from rbpf_svgp_slam.svgp.optimizers.optimizer import NotFinite, Optimizer
from rbpf_svgp_slam.svgp.posterior import Posterior

logger = logging.getLogger(__name__)

#: Settings that give the parameters their meaning: a map can only be loaded under the same.
STRUCTURE = ("inducing_points", "kernel", "jitter", "dtype", "optimizer")

# numpy looks for the smallest denormal once, and warns if it finds them flushed to zero: let it
# look before that.
np.finfo(np.float32), np.finfo(np.float64)


class SvgpMap(SeabedMap):
    """An SVGP, whose optimizer owns all that is learned.

    Maps of one shape share their work space within a thread, so that a map costs little more
    memory than its parameters and its optimizer's state.
    """

    support_label = "inducing points"

    #: Values of `svgp/optimizer` that make maps of this kind, and why others do not.
    OPTIMIZERS: ClassVar[Mapping[str, type[Optimizer]]]
    OTHERS: ClassVar[str]

    def __init__(self, config: SvgpConfig, survey_area: np.ndarray, common: Any = None) -> None:
        """survey_area: polygon [V, 2], m; common: what the maps of a node share, if anything."""
        self._allocate(config, common)
        S = config.inducing_points
        pitch_m = grid_pitch_m(survey_area, S)
        Z = initial_inducing_points(survey_area, S)
        self.optimizer.start(Z, config.lengthscale_m or 0.5 * pitch_m, pitch_m)

    def _allocate(self, config: SvgpConfig, common: Any) -> None:
        """Everything but the values of the parameters."""
        if config.optimizer not in self.OPTIMIZERS:
            raise TypeError(f"svgp/optimizer is {config.optimizer!r}: {self.OTHERS}")
        if config.device == "cuda" and not torch.cuda.is_available():
            raise ValueError("svgp/device is 'cuda'; expected cpu, torch finds no GPU here")
        self.config = config
        self.common = common
        self.optimizer = self._make_optimizer()
        self._convergence = Convergence(
            config.convergence_decay, config.convergence_window, config.convergence_tolerance
        )
        self._posterior: Posterior | None = None
        self._posterior_stamp: object = None
        self.iterations = 0
        self.skipped_steps = 0
        #: How often Kzz wanted a larger jitter than configured.
        self.jitter_raises = 0

    @abstractmethod
    def _make_optimizer(self) -> Any:
        """One of OPTIMIZERS, with what it has in common with others."""

    @property
    def ready(self) -> bool:
        return self._convergence.ready

    @property
    def objective(self) -> float:
        return self._convergence.average

    @property
    def noise_variance_m2(self) -> float:
        return self.optimizer.model.hyperparameters()[2]

    @property
    def prior_variance_m2(self) -> float:
        return self.optimizer.model.hyperparameters()[1]

    def _step(
        self,
        beams: np.ndarray,
        step: Callable[[torch.Tensor, torch.Tensor], float | None],
        reference_m: float,
    ) -> None:
        """One step of the optimizer on beams [n, 3], undone and counted if it is not finite.

        reference_m: what depths count from, in this step and from then on; NaN: from the mean of
        these beams' depths.
        """
        beams = _checked(beams, 3, "beams")
        if len(beams) == 0:
            raise ValueError("beams has shape (0, 3); expected at least one beam")
        # From the first step on the depths are small numbers, at 10 m of water as at 3000 m.
        if math.isnan(reference_m):
            reference_m = float(beams[:, 2].mean(dtype=np.float64))
        X = self._tensor(beams[:, :2])
        y = self._tensor(beams[:, 2].astype(np.float64) - reference_m)
        _flush_denormals()
        try:
            elbo = step(X, y)
        except (NotFinite, NotPositiveDefinite) as error:
            self.skipped_steps += 1
            logger.warning("training step undone, %d so far: %s", self.skipped_steps, error)
            return
        self.jitter_raises += self.optimizer.jitter_raises
        if elbo is not None:
            self._convergence.update(elbo)
        self.optimizer.reference_m = reference_m
        self._posterior = None
        self.iterations += 1

    def predict(self, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        X = self._tensor(_checked(xy, 2, "xy"))
        optimizer = self.optimizer
        _flush_denormals()
        if self._posterior is None or self._posterior_stamp is not optimizer.stamp:
            self._posterior = Posterior(
                optimizer.model, optimizer.gaussian(), self.config.kernel, optimizer.prior_inverse()
            )
            self._posterior_stamp = optimizer.stamp
        mean, variance = (v.cpu().numpy().astype(float) for v in self._posterior.marginals(X))
        reference_m = 0.0 if math.isnan(optimizer.reference_m) else optimizer.reference_m
        return mean + reference_m, variance

    def support_points(self) -> np.ndarray:
        Z = self.optimizer.model.Z.cpu().numpy().astype(float)
        return np.column_stack([Z, self.predict(Z)[0]])

    def copy(self) -> SvgpMap:
        twin = copy.copy(self)
        twin.optimizer = self.optimizer.copy()
        twin._convergence = copy.deepcopy(self._convergence)
        # The original's reads parameters that the original goes on to change.
        twin._posterior = None
        return twin

    def to_bytes(self) -> bytes:
        convergence = self._convergence
        return state.encode(
            {
                "config": json.dumps(self.config.as_dict()),
                "iterations": self.iterations,
                "skipped_steps": self.skipped_steps,
                "jitter_raises": self.jitter_raises,
                "reference_m": self.optimizer.reference_m,
                "averages": np.array(convergence.averages, dtype=float),
                "average_weight": convergence.weight,
                "raw_average": convergence.raw_average,
                "ready": self.ready,
                **self.optimizer.arrays(),
            }
        )

    @classmethod
    def from_bytes(
        cls, data: bytes, config: SvgpConfig | None = None, common: Any = None
    ) -> SvgpMap:
        """The map that wrote the bytes; config none: with its own settings, on the CPU.

        Raises ValueError if the bytes are damaged, or of a map that the settings do not fit.
        """
        return cls.from_entries(state.decode(data), config, common)

    @classmethod
    def from_entries(
        cls,
        entries: dict[str, np.ndarray],
        config: SvgpConfig | None = None,
        common: Any = None,
    ) -> SvgpMap:
        """The same from what `state.decode` returns."""
        written = state.written_config(entries)
        config = config or replace(written, device="cpu")
        for name in STRUCTURE:
            theirs, ours = getattr(written, name), getattr(config, name)
            if theirs != ours:
                raise ValueError(f"map was written with svgp/{name} {theirs!r}; expected {ours!r}")
        restored = cls.__new__(cls)
        restored._allocate(config, common)
        restored._restore(entries)
        return restored

    def _restore(self, entries: dict[str, np.ndarray]) -> None:
        """Take over the entries of a decoded state."""
        convergence = self._convergence
        state.expect_entries(entries, self.optimizer.ENTRIES)
        self.optimizer.restore(entries)
        self.optimizer.restore_reference(entries["reference_m"].item())
        convergence.averages.extend(entries["averages"].tolist())
        convergence.weight = entries["average_weight"].item()
        convergence.raw_average = entries["raw_average"].item()
        convergence.ready = entries["ready"].item()
        self.iterations = entries["iterations"].item()
        self.skipped_steps = entries["skipped_steps"].item()
        self.jitter_raises = entries["jitter_raises"].item()

    def _tensor(self, array: np.ndarray) -> torch.Tensor:
        """In this map's precision, where this map lives."""
        optimizer, contiguous = self.optimizer, np.ascontiguousarray(array)
        return torch.as_tensor(contiguous, dtype=optimizer.dtype, device=optimizer.device)


def _flush_denormals() -> None:
    """Flush denormals to zero in this thread: kernels yield them at large distances, and CPUs are
    slow on them."""
    torch.set_flush_denormal(True)


def _checked(points: np.ndarray, columns: int, name: str) -> np.ndarray:
    """Array [n, columns] of finite numbers."""
    points = np.asarray(points)
    if points.ndim != 2 or points.shape[1] != columns:
        raise ValueError(f"{name} has shape {points.shape}; expected [n, {columns}]")
    bad = np.count_nonzero(~np.isfinite(points).all(axis=1))
    if bad:
        raise ValueError(f"{bad} of {len(points)} {name} are not finite; expected none")
    return points
