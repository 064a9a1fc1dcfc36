"""A map that learns from random beams, again and again."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING

from rbpf_svgp_slam.maps.seabed_map import SeabedMap

if TYPE_CHECKING:
    import numpy as np


class MinibatchMap(SeabedMap):
    """A map that takes training steps on minibatches: beams drawn from the whole log."""

    @abstractmethod
    def train_step(self, beams: np.ndarray, beams_in_log: int) -> None:
        """One step on beams [M, 3] (x, y, z), drawn from a log that holds N of them now."""
