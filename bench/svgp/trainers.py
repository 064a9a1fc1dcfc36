"""What a map node does with its maps, for one map and a log in memory, and on a stopwatch."""

from __future__ import annotations

import time
from typing import Any, Callable

import numpy as np


class MinibatchTrainer:
    """A map that learns from minibatches."""

    def __init__(self, engine: Any, beams: np.ndarray, M: int, rng: np.random.Generator) -> None:
        """beams [N, 3] in order of arrival, m."""
        self.map = engine
        self._beams, self._M, self._rng = beams, M, rng

    def advance(self, arrived: int) -> float:
        """Wall time, s, of one step on the first `arrived` beams; drawing them does not count."""
        return seconds(self.map.train_step, self._draw(arrived, self._M), arrived)

    def _draw(self, arrived: int, count: int) -> np.ndarray:
        return self._beams[self._rng.integers(0, arrived, count)]


class StreamTrainer(MinibatchTrainer):
    """A map that takes in every beam once, with its teacher: see map_node/stream_training.py.

    It pays for the teacher alone, as in a node of one map.
    """

    def __init__(self, group: Any, beams: np.ndarray, M: int, rng: np.random.Generator) -> None:
        """group: `SvgpGroup`; the rest as above."""
        # here, since it loads ROS, which the others do without
        from rbpf_svgp_slam.map_node.stream_training import BLOCK_BEAMS, REBUILD_SHARE

        super().__init__(group.create(), beams, M, rng)
        self._block, self._pause = BLOCK_BEAMS, 1.0 / REBUILD_SHARE - 1.0
        self._group = group
        self._spent_s = self._next_rebuild_s = 0.0

    def advance(self, arrived: int) -> float:
        """Wall time, s, of a round: a step of the teacher, the next beams, perhaps a rebuild."""
        teach = self._group.teacher.train_step
        cost_s = seconds(teach, self._draw(arrived, self._M), arrived)
        first = self.map.next_beam
        if first < arrived:
            cost_s += seconds(self.map.take_in, self._beams[first:arrived][: self._block])
        if self._spent_s >= self._next_rebuild_s and self.map.outdated:
            rebuild_s = seconds(self.map.rebuild, self._sample(arrived), arrived)
            cost_s += rebuild_s
            self._next_rebuild_s = self._spent_s + cost_s + self._pause * rebuild_s
        self._spent_s += cost_s
        return cost_s

    def _sample(self, arrived: int) -> np.ndarray:
        """All beams so far, or as many as a rebuild wants of them."""
        wanted = self._group.rebuild_beams
        return self._beams[:arrived] if arrived <= wanted else self._draw(arrived, wanted)


def seconds(function: Callable[..., None], *arguments: Any) -> float:
    """Wall time of a call."""
    started_s = time.perf_counter()
    function(*arguments)
    return time.perf_counter() - started_s
