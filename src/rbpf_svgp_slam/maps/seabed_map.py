"""What everybody but its trainer asks of a map."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar

if TYPE_CHECKING:
    import numpy as np


class SeabedMap(ABC):
    """A probabilistic map of the seabed, made from beams; how is for `MinibatchMap`, `StreamMap`.

    Horizontal positions are metres relative to the survey origin (small enough for float32),
    z is metres upwards. A map is used by one thread at a time.
    """

    #: What the engine calls its `support_points`, for figures: "inducing points", say.
    support_label: ClassVar[str]

    iterations: int  #: training steps taken
    skipped_steps: int  #: steps undone, because they would have given a value that is not finite

    @property
    @abstractmethod
    def ready(self) -> bool:
        """The map is good enough to be matched against; may turn false again.

        The core weights the particles by a ping, which is called a *prompt*, only while all maps
        are ready.
        """

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
    def predict(self, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean [n], m, and variance [n], m², of the seabed's z at [n, 2]; noise not included."""

    @abstractmethod
    def support_points(self) -> np.ndarray:
        """Points [S, 3] (x, y, predicted z) that show where the map spends its memory."""

    @abstractmethod
    def copy(self) -> SeabedMap:
        """A map of the same group that goes on from here, independently of this one."""

    @abstractmethod
    def to_bytes(self) -> bytes:
        """Everything that training and prediction go on from; see `MapGroup.load`."""
