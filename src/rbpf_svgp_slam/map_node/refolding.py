"""New maps from the log's first beam on, as the corrected histories have it; free of ROS."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Callable, Iterator, Sequence

import numpy as np

from rbpf_svgp_slam.maps import MapGroup
from rbpf_svgp_slam.maps.log_block import LogBlock


@dataclass
class Branch:
    """Particles whose histories have been the same so far, and their map."""

    members: list[int]  # rows of a block's poses
    map: Any


class Refolding:
    """The maps of some particles, made aside while the old ones stay in use.

    Histories form a tree: those that are the same at one ping have been the same at all pings
    before. So there is one map at first, and where histories part, each of them goes on with a
    copy: no beam is taken in twice at the same place but by maps that differ already.
    """

    def __init__(self, group: MapGroup, particles: Sequence[int], share: float = 1.0) -> None:
        """share: of the log's beams that are taken in, drawn at random, above 0."""
        self._group = group
        self._particles = list(particles)
        self._share = share
        self._branches = [Branch(list(range(len(self._particles))), group.create_anew())]
        #: Index in the log of the first beam that nothing is known of.
        self.next_beam = 0
        #: Beams taken in so far, by each map, and by all maps together.
        self.taken = 0
        self.folded = 0

    def steps(self, block: LogBlock, size: int) -> Iterator[Callable[[], None]]:
        """What takes in the log's beams from `next_beam` on, up to `size` at a time.

        block: with poses [P, K] by particle. The steps are to be called in their order, others may
        use maps in between; if one raises, these maps are of no use any more.
        """
        drawn = block.beams_at(self._drawn(len(block)))
        for start in range(0, len(drawn), size):
            part = drawn.part(start, min(start + size, len(drawn)))
            yield lambda: self._part_ways(part.poses)
            self.taken += len(part)
            for first in range(0, len(self._branches), self._group.maps_at_once):
                some = self._branches[first : first + self._group.maps_at_once]
                yield lambda: self._take_in(some, part)
        self.next_beam += len(block)

    def maps(self) -> dict[int, Any]:
        """A map for each particle; to be called once, at the end."""
        maps = {}
        for branch in self._branches:
            if self.taken < self.next_beam:
                branch.map.stand_for(self.next_beam)
            for row in branch.members:
                own = branch.map if row == branch.members[0] else branch.map.copy()
                maps[self._particles[row]] = own
        return {particle: maps[particle] for particle in self._particles}

    def _drawn(self, beams: int) -> np.ndarray:
        """Numbers of the beams that are taken in; the same in every run."""
        if self._share >= 1.0:
            return np.arange(beams)
        return np.flatnonzero(np.random.default_rng(self.next_beam).random(beams) < self._share)

    def _part_ways(self, poses: np.ndarray) -> None:
        self._branches = [part for branch in self._branches for part in _parted(branch, poses)]

    def _take_in(self, branches: list[Branch], block: LogBlock) -> None:
        maps = [branch.map for branch in branches]
        self._group.take_in(maps, block.rows([branch.members[0] for branch in branches]))
        if any(one.next_beam != self.taken for one in maps):
            raise ArithmeticError("a map has not taken its beams in")
        self.folded += len(maps) * len(block)


def _parted(branch: Branch, poses: np.ndarray) -> list[Branch]:
    """The branch, or what becomes of it where its members' poses differ within a block."""
    by_poses: dict[bytes, list[int]] = {}
    for row in branch.members:
        by_poses.setdefault(poses[row].tobytes(), []).append(row)
    first, *others = by_poses.values()
    copies = [Branch(members, branch.map.copy()) for members in others]
    return [Branch(first, branch.map), *copies]
