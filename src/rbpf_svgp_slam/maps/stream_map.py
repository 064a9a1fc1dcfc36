"""A map that takes in every beam once."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, Callable

from rbpf_svgp_slam.maps.seabed_map import SeabedMap

if TYPE_CHECKING:
    import numpy as np


class StreamMap(SeabedMap):
    """A map that takes in every beam of the log once, in the log's order.

    What such maps of one node have in common may be learned by their group's *teacher*, a
    `MinibatchMap`. Once it has learned enough, a map is `outdated` and gets a `rebuild`. Maps
    without a teacher need neither.
    """

    @property
    @abstractmethod
    def next_beam(self) -> int:
        """Index in the log of the first beam not taken in."""

    @abstractmethod
    def take_in(self, beams: np.ndarray) -> None:
        """Take in the log's beams [n, 3] (x, y, z) from `next_beam` on."""

    @property
    def outdated(self) -> bool:
        """A `rebuild` is due."""
        return False

    def rebuild(
        self, beams: np.ndarray, beams_in_log: int, pause: Callable[[], None] = lambda: None
    ) -> None:
        """Start again with what the teacher knows now.

        beams [n, 3]: the log's first `beams_in_log` beams, or a uniform sample of them; pause:
        called now and then, while the map is what it was. What that raises ends the rebuild,
        without effect.
        """
        raise NotImplementedError(f"{type(self).__name__} is never outdated")

    def stand_for(self, beams_in_log: int) -> None:
        """What has been taken in was a uniform sample of so many of the log's first beams."""
        raise NotImplementedError(f"{type(self).__name__} is made of all beams")
