"""What the nodes ask of a map, whatever stands behind it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, Callable, ClassVar

import numpy as np


class MapEngine(ABC):
    """A probabilistic map of the seabed, made from beams.

    A map either learns from minibatches (`train_step`), or takes in every beam once, in the log's
    order (`next_beam`, `take_in`), while a *teacher*, a map of the first kind, learns for all such
    maps of a node what they have in common.

    Horizontal positions are metres relative to the survey origin (small enough for float32),
    z is metres upwards. A map is used by one thread at a time.
    """

    #: Class of the engine's settings; has `from_parameters(group)` and a field `minibatch_size`.
    config_class: ClassVar[type]

    iterations: int  #: training steps taken
    skipped_steps: int  #: steps undone, because they would have given a value that is not finite

    @classmethod
    def make_group(cls, config: Any, survey_area: np.ndarray) -> Any:
        """What the maps of one node have in common: passed to each; may have a `teacher`."""
        return None

    @abstractmethod
    def __init__(self, config: Any, survey_area: np.ndarray, group: Any = None) -> None:
        """A map that has seen nothing; survey_area: polygon [V, 2], m."""

    @property
    @abstractmethod
    def ready(self) -> bool:
        """Training has converged; may turn false again."""

    @property
    @abstractmethod
    def objective(self) -> float:
        """Moving average of what training maximises, nats per beam; NaN before the first step."""

    @property
    @abstractmethod
    def noise_variance_m2(self) -> float:
        """Variance of a beam's z about the seabed, as learned."""

    @property
    @abstractmethod
    def prior_variance_m2(self) -> float:
        """Variance of the seabed's z far from all beams."""

    @abstractmethod
    def train_step(self, beams: np.ndarray, beams_in_log: int) -> None:
        """One step on beams [M, 3] (x, y, z), drawn from a log that holds N of them now."""

    @property
    def next_beam(self) -> int | None:
        """Index in the log of the first beam not taken in; none: it learns from minibatches."""
        return None

    def take_in(self, beams: np.ndarray) -> None:
        """Take in the log's beams [n, 3] from `next_beam` on."""
        raise NotImplementedError(f"{type(self).__name__} learns from minibatches")

    @property
    def outdated(self) -> bool:
        """The teacher has learned so much that a `rebuild` is due."""
        return False

    def rebuild(
        self, beams: np.ndarray, beams_in_log: int, pause: Callable[[], None] = lambda: None
    ) -> None:
        """Start again with what the teacher knows now.

        beams [n, 3]: the log's first `beams_in_log` beams, or a uniform sample of them; pause:
        called now and then, while the map is what it was. What that raises ends the rebuild,
        without effect.
        """
        raise NotImplementedError(f"{type(self).__name__} learns from minibatches")

    @abstractmethod
    def predict(self, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean [n], m, and variance [n], m², of the seabed's z at [n, 2]; noise not included."""

    @abstractmethod
    def support_points(self) -> np.ndarray:
        """Points [S, 3] (x, y, predicted z) that show where the map spends its memory."""

    @abstractmethod
    def copy(self) -> "MapEngine":
        """A map of the same group that goes on from here, independently of this one."""

    @abstractmethod
    def to_bytes(self) -> bytes:
        """Everything that training and prediction go on from."""

    @classmethod
    @abstractmethod
    def from_bytes(cls, data: bytes, config: Any = None, group: Any = None) -> "MapEngine":
        """The map that wrote the bytes, with its own settings if none are given.

        In a group it shares what the group shares; without one it stands alone.

        Raises ValueError if the bytes are damaged, of another engine or version, or of a map that
        the settings do not fit.
        """
