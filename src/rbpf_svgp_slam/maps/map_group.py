"""The maps of one node: how they are made, and what they have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, Mapping, Sequence

from rbpf_svgp_slam.maps.minibatch_map import MinibatchMap
from rbpf_svgp_slam.maps.seabed_map import SeabedMap
from rbpf_svgp_slam.maps.stream_map import StreamMap

if TYPE_CHECKING:
    import numpy as np

    from rbpf_svgp_slam.maps.log_block import LogBlock


class MapGroup(ABC):
    """Makes equal maps and restores copies of them; an engine's entrance."""

    #: The contract that the maps fulfil decides how they are trained.
    map_class: type[MinibatchMap] | type[StreamMap]
    #: The map that learns for this node's, where they stream and have something to learn.
    teacher: MinibatchMap | None = None
    #: Beams that a training step wants, of the maps' or the teacher's; 0: there are none.
    minibatch_size: int = 0
    #: Largest sample of beams that a map is made from anew: by a `rebuild`, or from the log's first
    #: beam on where the histories have been corrected. 0: there is no `rebuild`, and a map is made
    #: from all beams.
    rebuild_beams: int = 0
    #: How many maps `take_in` may be given at once. Others must wait while it works.
    maps_at_once: int = 1

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

    def create_anew(self) -> Any:
        """A `StreamMap` which has seen nothing, under what maps of this node have learned."""
        return self.create()

    @abstractmethod
    def load(self, data: bytes) -> Any:
        """The map that wrote the bytes, as one of this node's.

        Raises ValueError if the bytes are damaged, of another engine or version, or of a map that
        this group's parameters do not fit.
        """

    # What a node does with several of its maps at once. An engine may have a faster way.

    def take_in(self, maps: Sequence[StreamMap], block: LogBlock) -> None:
        """The log's beams from the maps' common `next_beam` on, poses [P, K] by map."""
        for row, one in enumerate(maps):
            one.take_in(block.placed(row))

    def predict(
        self, maps: Sequence[SeabedMap], positions: np.ndarray
    ) -> list[tuple[np.ndarray, np.ndarray]]:
        """Mean and variance by map, each at its own positions; [P, n, 2] as `SeabedMap.predict`."""
        return [one.predict(xy) for one, xy in zip(maps, positions)]

    def serialise(self, maps: Sequence[SeabedMap], known: bytes) -> list[bytes]:
        """The maps for another node, which has what `known_pieces` told, and loads them in order.

        Maps or parts of them that it has, or that an earlier one of these maps brought, may be left
        out.
        """
        return [one.to_bytes() for one in maps]

    def known_pieces(self) -> bytes:
        """What this node's maps have in common with other nodes', for their `serialise`."""
        return b""

    # What all maps of all nodes have in common, and must know before the first beam is taken in.

    def study_due(self, beams_in_log: int) -> tuple[int, int] | None:
        """First beam in the log and number of those to be studied now; none: nothing is due.

        They are placed by the first particle's history, on every node, so that all nodes come to
        the same result. Maps take in nothing while a first study is due.
        """
        return None

    def study(self, beams: np.ndarray) -> None:
        """Learn from the beams [n, 3] that were due. May take seconds; maps stay in use."""
        raise NotImplementedError(f"{type(self).__name__} studies no beams")

    @property
    def studied(self) -> bool:
        """Maps may take beams in."""
        return True

    def load_alone(self, data: bytes) -> SeabedMap:
        """The map that wrote the bytes, independent of all others; raises as `load`."""
        return self.load_saved(data)

    @classmethod
    @abstractmethod
    def load_saved(cls, data: bytes) -> SeabedMap:
        """The map that wrote the bytes, with the parameters that it was made with.

        Without a node, for reports, say. Raises ValueError if the bytes are not a map's.
        """
