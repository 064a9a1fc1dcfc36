"""New maps from the log's first beam on, as the corrected histories have it; free of ROS."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Sequence

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
    copy. No beam is taken in twice at the same place but by copies that differ already.
    """

    def __init__(self, group: MapGroup, particles: Sequence[int]) -> None:
        self._group = group
        self._particles = list(particles)
        self._branches = [Branch(list(range(len(self._particles))), group.create())]
        #: Index in the log of the first beam not taken in.
        self.next_beam = 0

    @property
    def distinct(self) -> int:
        """Maps so far."""
        return len(self._branches)

    def take_in(self, block: LogBlock) -> None:
        """The log's beams from `next_beam` on, with poses [P, K] by particle."""
        self._branches = [
            part for branch in self._branches for part in self._parted(branch, block.poses)
        ]
        first_rows = [branch.members[0] for branch in self._branches]
        self._group.take_in([branch.map for branch in self._branches], block.rows(first_rows))
        self.next_beam += len(block)

    def maps(self) -> dict[int, Any]:
        """A map for each particle; to be called once, at the end."""
        maps = {}
        for branch in self._branches:
            for row in branch.members:
                own = branch.map if row == branch.members[0] else branch.map.copy()
                maps[self._particles[row]] = own
        return {particle: maps[particle] for particle in self._particles}

    def _parted(self, branch: Branch, poses: np.ndarray) -> list[Branch]:
        """The branch, or what becomes of it where its members' poses differ within a block."""
        by_poses: dict[bytes, list[int]] = {}
        for row in branch.members:
            by_poses.setdefault(poses[row].tobytes(), []).append(row)
        first, *others = by_poses.values()
        copies = [Branch(members, branch.map.copy()) for members in others]
        return [Branch(first, branch.map), *copies]
