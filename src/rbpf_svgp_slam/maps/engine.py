"""What the nodes ask of a map, whatever stands behind it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np


class MapEngine(ABC):
    """A probabilistic map of the seabed that is trained on minibatches of beams.

    Horizontal positions are metres relative to the survey origin (small enough for float32),
    z is metres upwards. A map is used by one thread at a time.
    """

    #: Class of the engine's settings; has `from_parameters(group)` and a field `minibatch_size`.
    config_class: ClassVar[type]

    iterations: int  #: training steps taken
    skipped_steps: int  #: steps undone, because they would have given a value that is not finite

    @abstractmethod
    def __init__(self, config: Any, survey_area: np.ndarray) -> None:
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

    @abstractmethod
    def predict(self, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean [n], m, and variance [n], m², of the seabed's z at [n, 2]; noise not included."""

    @abstractmethod
    def support_points(self) -> np.ndarray:
        """Points [S, 3] (x, y, predicted z) that show where the map spends its memory."""

    @abstractmethod
    def to_bytes(self) -> bytes:
        """Everything that training and prediction go on from."""

    @classmethod
    @abstractmethod
    def from_bytes(cls, data: bytes, config: Any = None) -> "MapEngine":
        """The map that wrote the bytes, with its own settings if none are given.

        Raises ValueError if the bytes are damaged, of another engine or version, or of a map that
        the settings do not fit.
        """
