"""The maps of one node: how they are made, and what they have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, Mapping

from rbpf_svgp_slam.maps.minibatch_map import MinibatchMap
from rbpf_svgp_slam.maps.seabed_map import SeabedMap
from rbpf_svgp_slam.maps.stream_map import StreamMap

if TYPE_CHECKING:
    import numpy as np


class MapGroup(ABC):
    """Makes equal maps and restores copies of them; an engine's entrance."""

    #: The contract that the maps fulfil decides how they are trained.
    map_class: type[MinibatchMap] | type[StreamMap]
    #: The map that learns for this node's, where they stream and have something to learn.
    teacher: MinibatchMap | None = None
    #: Beams that a training step wants, of the maps' or the teacher's; 0: there are none.
    minibatch_size: int = 0
    #: Largest sample of beams that a `rebuild` wants; 0: there is none.
    rebuild_beams: int = 0

    @classmethod
    @abstractmethod
    def from_parameters(cls, parameters: Mapping[str, Any], survey_area: np.ndarray) -> MapGroup:
        """The group of a node.

        parameters: the parameter group of the engine's name, to be checked here; survey_area:
        polygon [V, 2] relative to the survey origin, m. Raises ValueError, the message beginning
        with the parameter's name, if one is not as expected.
        """

    @abstractmethod
    def create(self) -> Any:
        """A new map of this node, which has seen nothing; all are equal."""

    @abstractmethod
    def load(self, data: bytes) -> Any:
        """The map that wrote the bytes, as one of this node's.

        Raises ValueError if the bytes are damaged, of another engine or version, or of a map that
        this group's parameters do not fit.
        """

    def load_alone(self, data: bytes) -> SeabedMap:
        """The map that wrote the bytes, independent of all others; raises as `load`."""
        return self.load_saved(data)

    @classmethod
    @abstractmethod
    def load_saved(cls, data: bytes) -> SeabedMap:
        """The map that wrote the bytes, with the parameters that it was made with.

        Without a node, for reports, say. Raises ValueError if the bytes are not a map's.
        """
