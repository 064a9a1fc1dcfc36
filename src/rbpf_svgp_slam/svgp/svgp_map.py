"""The SVGP behind the nodes' map interface."""

from __future__ import annotations

import copy
import json
import logging
import math
from dataclasses import replace
from typing import Callable

import numpy as np
import torch

from rbpf_svgp_slam.maps.engine import MapEngine
from rbpf_svgp_slam.svgp import state
from rbpf_svgp_slam.svgp.config import SvgpConfig
from rbpf_svgp_slam.svgp.convergence import Convergence
from rbpf_svgp_slam.svgp.group import SvgpGroup, make_optimizer
from rbpf_svgp_slam.svgp.inducing import grid_pitch_m, initial_inducing_points
from rbpf_svgp_slam.svgp.linalg import NotPositiveDefinite
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

    @classmethod
    def make_group(cls, config: SvgpConfig, survey_area: np.ndarray) -> SvgpGroup:
        streams = config.optimizer == "streaming"
        learner = replace(config, optimizer="natgrad")
        return SvgpGroup.for_node(config, cls(learner, survey_area) if streams else None)

    def __init__(
        self, config: SvgpConfig, survey_area: np.ndarray, group: SvgpGroup | None = None
    ) -> None:
        self._allocate(config, group)
        S = config.inducing_points
        pitch_m = grid_pitch_m(survey_area, S)
        Z = initial_inducing_points(survey_area, S)
        self._optimizer.start(Z, config.lengthscale_m or 0.5 * pitch_m, pitch_m)

    def _allocate(self, config: SvgpConfig, group: SvgpGroup | None) -> None:
        """Everything but the values of the parameters."""
        if config.device == "cuda" and not torch.cuda.is_available():
            raise ValueError("svgp/device is 'cuda'; expected cpu, torch finds no GPU here")
        self.config = config
        self._group = group or SvgpGroup()
        self._optimizer = make_optimizer(config, self._group)
        self._convergence = Convergence(
            config.convergence_decay, config.convergence_window, config.convergence_tolerance
        )
        self._own_reference_m = math.nan
        self._posterior: Posterior | None = None
        self._posterior_stamp: object = None
        self.iterations = 0
        self.skipped_steps = 0
        #: How often Kzz wanted a larger jitter than configured.
        self.jitter_raises = 0

    @property
    def ready(self) -> bool:
        return self._judge().ready

    @property
    def objective(self) -> float:
        return self._judge().average

    @property
    def _reference_m(self) -> float:
        """What this map's depths count from: the model's c is an offset to it."""
        shared = self._group.shared
        return self._own_reference_m if shared is None else shared.reference_m

    @_reference_m.setter
    def _reference_m(self, reference_m: float) -> None:
        if self._group.shared is None:
            self._own_reference_m = reference_m
        else:
            self._group.shared.reference_m = reference_m

    def _judge(self) -> Convergence:
        """Of the map that learns this one's model, if that is another."""
        follows = self.config.optimizer == "streaming" and self._group.teacher is not None
        return self._group.teacher._convergence if follows else self._convergence

    @property
    def noise_variance_m2(self) -> float:
        return self._optimizer.model.hyperparameters()[2]

    @property
    def prior_variance_m2(self) -> float:
        return self._optimizer.model.hyperparameters()[1]

    def train_step(self, beams: np.ndarray, beams_in_log: int) -> None:
        if beams_in_log < 1:
            raise ValueError(f"beams_in_log is {beams_in_log}; expected at least 1")
        self._step(beams, lambda X, y: self._optimizer.step(X, y, beams_in_log))

    # A map that takes in every beam once

    @property
    def next_beam(self) -> int | None:
        return self._optimizer.next_beam

    def take_in(self, beams: np.ndarray) -> None:
        self._step(beams, self._optimizer.fold)

    @property
    def outdated(self) -> bool:
        return self._group.teacher is not None and self._optimizer.fixed is not self._group.model()

    def rebuild(
        self, beams: np.ndarray, beams_in_log: int, pause: Callable[[], None] = lambda: None
    ) -> None:
        fixed = self._group.model()
        # The model's c counts from the teacher's reference.
        self._step(
            beams,
            lambda X, y: self._optimizer.rebuild(fixed, X, y, beams_in_log, pause),
            self._group.teacher._reference_m,
        )

    def _step(
        self,
        beams: np.ndarray,
        step: Callable[[torch.Tensor, torch.Tensor], float | None],
        reference_m: float | None = None,
    ) -> None:
        """One step of the optimizer on beams [n, 3], undone and counted if it is not finite.

        reference_m: what depths count from, from this step on, if that changes.
        """
        beams = _checked(beams, 3, "beams")
        if len(beams) == 0:
            raise ValueError("beams has shape (0, 3); expected at least one beam")
        # From the first step on the depths are small numbers, at 10 m of water as at 3000 m.
        reference_m = self._reference_m if reference_m is None else reference_m
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
        self.jitter_raises += self._optimizer.jitter_raises
        if elbo is not None:
            self._convergence.update(elbo)
        self._reference_m = reference_m
        self._posterior = None
        self.iterations += 1

    def predict(self, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        X = self._tensor(_checked(xy, 2, "xy"))
        optimizer = self._optimizer
        _flush_denormals()
        if self._posterior is None or self._posterior_stamp is not optimizer.stamp:
            self._posterior = Posterior(
                optimizer.model, optimizer.gaussian(), self.config.kernel, optimizer.prior_inverse()
            )
            self._posterior_stamp = optimizer.stamp
        mean, variance = (v.cpu().numpy().astype(float) for v in self._posterior.marginals(X))
        reference_m = 0.0 if math.isnan(self._reference_m) else self._reference_m
        return mean + reference_m, variance

    def support_points(self) -> np.ndarray:
        Z = self._optimizer.model.Z.cpu().numpy().astype(float)
        return np.column_stack([Z, self.predict(Z)[0]])

    def copy(self) -> SvgpMap:
        twin = copy.copy(self)
        twin._optimizer = self._optimizer.copy()
        twin._convergence = copy.deepcopy(self._convergence)
        twin._posterior = (
            None  # the original's reads parameters that the original goes on to change
        )
        return twin

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
                "ready": self.ready,
                **self._optimizer.arrays(),
            }
        )

    @classmethod
    def from_bytes(
        cls, data: bytes, config: SvgpConfig | None = None, group: SvgpGroup | None = None
    ) -> SvgpMap:
        entries = state.decode(data)
        written = _written_config(entries["config"].item())
        config = config or replace(written, device="cpu")
        for name in STRUCTURE:
            theirs, ours = getattr(written, name), getattr(config, name)
            if theirs != ours:
                raise ValueError(f"map was written with svgp/{name} {theirs!r}; expected {ours!r}")
        restored = cls.__new__(cls)
        restored._allocate(config, group)
        restored._restore(entries)
        return restored

    def _restore(self, entries: dict[str, np.ndarray]) -> None:
        """Take over the entries of a decoded state."""
        convergence = self._convergence
        state.expect_entries(entries, self._optimizer.ENTRIES)
        self._optimizer.restore(entries)
        self._group.welcome(self._optimizer)
        convergence.averages.extend(entries["averages"].tolist())
        convergence.weight = entries["average_weight"].item()
        convergence.raw_average = entries["raw_average"].item()
        convergence.ready = entries["ready"].item()
        reference_m = entries["reference_m"].item()
        if math.isnan(self._reference_m):
            self._reference_m = reference_m
        elif not math.isnan(reference_m):
            self._optimizer.site.move_reference(reference_m - self._reference_m)
        self.iterations = entries["iterations"].item()
        self.skipped_steps = entries["skipped_steps"].item()
        self.jitter_raises = entries["jitter_raises"].item()

    def _tensor(self, array: np.ndarray) -> torch.Tensor:
        """In this map's precision, where this map lives."""
        optimizer, contiguous = self._optimizer, np.ascontiguousarray(array)
        return torch.as_tensor(contiguous, dtype=optimizer.dtype, device=optimizer.device)


def _flush_denormals() -> None:
    """In this thread: as of the kernel at large distances, they take many CPUs very long."""
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


def _written_config(text: str) -> SvgpConfig:
    try:
        return SvgpConfig(**json.loads(text))
    except (TypeError, ValueError) as error:
        raise ValueError(f"map's config is not that of an SVGP ({error})") from error
