"""A stretch of the log, as it is sent to maps that take in every beam once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Sequence

import numpy as np

#: A particle's pose at a ping, ready to place beams: x, y relative to the survey origin, m.
POSE = np.dtype([("x", "<f8"), ("y", "<f8"), ("cos", "<f4"), ("sin", "<f4")])


@dataclass(frozen=True)
class LogBlock:
    """n beams of K pings, levelled, and where each of P particles has these pings."""

    levelled: np.ndarray  # [n, 3] float32: x, y in the levelled body frame, z in the map frame, m
    beams_of_ping: np.ndarray  # [K], sums to n: a ping's beams follow one another
    poses: np.ndarray  # [P, K] of POSE

    def __len__(self) -> int:
        return len(self.levelled)

    @property
    def ping_of_beam(self) -> np.ndarray:
        """Number [n] of each beam's ping, 0 .. K - 1."""
        return np.repeat(np.arange(len(self.beams_of_ping)), self.beams_of_ping)

    def rows(self, rows: Sequence[int]) -> LogBlock:
        """The same beams with the poses of some of the particles."""
        return replace(self, poses=self.poses[list(rows)])

    def part(self, first: int, last: int) -> LogBlock:
        """Its beams first .. last - 1, and the poses of their pings."""
        ends = np.clip(np.cumsum(self.beams_of_ping), first, last)
        counts = np.diff(ends, prepend=first)
        pings = np.flatnonzero(counts)
        return LogBlock(self.levelled[first:last], counts[pings], self.poses[:, pings])

    def beams_at(self, numbers: np.ndarray) -> LogBlock:
        """Some of its beams, numbers [n] rising, and the poses of their pings."""
        pings, beams_of_ping = np.unique(self.ping_of_beam[numbers], return_counts=True)
        return LogBlock(self.levelled[numbers], beams_of_ping, self.poses[:, pings])

    def placed(self, row: int) -> np.ndarray:
        """The beams [n, 3] (x, y, z), float32 m, where one particle has them."""
        pose = self.poses[row][self.ping_of_beam]
        x, y, z = self.levelled.T
        east = pose["x"].astype(np.float32) + (pose["cos"] * x - pose["sin"] * y)
        north = pose["y"].astype(np.float32) + (pose["sin"] * x + pose["cos"] * y)
        return np.column_stack([east, north, z])
