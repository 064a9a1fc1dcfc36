"""The training of maps that take in every beam once."""

from __future__ import annotations

import itertools
from concurrent.futures import Future, wait
from dataclasses import replace
from typing import Callable

import numpy as np
import rospy

from rbpf_svgp_slam.map_node.background import AtOnce, Background
from rbpf_svgp_slam.map_node.core_client import (
    Answer,
    BeamReader,
    Feed,
    LogFeed,
    MinibatchFeed,
    Minibatches,
)
from rbpf_svgp_slam.map_node.map_store import MapStore
from rbpf_svgp_slam.map_node.refolding import Refolding
from rbpf_svgp_slam.map_node.training import IDLE_S, Training
from rbpf_svgp_slam.map_node.turns import EndTurn, TurnFeed, WallClock, WorkClock
from rbpf_svgp_slam.maps import MapGroup
from rbpf_svgp_slam.maps.log_block import LogBlock

# Beams of each map that are asked for at once.
BLOCK_BEAMS = 1024
# To follow, all maps together take in as many beams as so many rebuilds; how many histories differ
# is counted at these parts of the log.
FOLLOWING_REBUILDS, PROBED_PARTS = 4, (0.1, 0.3, 0.5, 0.7, 0.9)
# Blocks that are asked for at once where maps are made again; and beams of all particles together.
REFOLD_BLOCKS, LARGEST_READ = 20, 10_000_000
# Live, time between two questions for new beams: a block costs more, per beam, the shorter it is.
READ_PERIOD_S = 0.5
# Largest share of the time that is spent on rebuilding maps.
REBUILD_SHARE = 0.3


class StreamTraining(Training):
    """Every map takes in every beam once; if there is a teacher, it learns for all of them.

    The teacher's minibatches are placed by the histories of the node's particles in turn: what it
    learns must not fit one particle better than another. Without a teacher the core is asked for
    no minibatches, but only how long the log is and in which epoch.
    """

    def __init__(
        self,
        store: MapStore,
        group: MapGroup,
        between_steps: Callable[[], None],
        end_turn: EndTurn | None = None,
    ) -> None:
        """end_turn: none if live; under an offline replay, tells the node's state (turns.py)."""
        super().__init__(store, _make_feed(store, group, end_turn), between_steps)
        self._core = BeamReader()
        self._group = group
        self._has_teacher = group.teacher is not None
        self._rebuild_beams = group.rebuild_beams
        # What rebuilding has its share of: the time itself if live, else the work done.
        self._clock = WallClock() if end_turn is None else WorkClock()
        # Live, other work goes on while beams are on their way; in turns everything has its order.
        self._reads = Background("beams") if end_turn is None else AtOnce()
        self._block: Future | None = None  # next beams of the log, on their way
        self._first = 0  # of them
        self._asked_for: list[int] = []  # particles whose maps lack them
        self._stuck: set[int] = set()  # particles whose maps have not taken in what they were given
        self._sample: Future | None = None  # of the log, for a rebuild, on its way
        # Without a teacher the feed itself rests for so long.
        self._read_period = READ_PERIOD_S if end_turn is None and self._has_teacher else 0.0
        self._next_read = 0.0  # by the clock, as the next
        self._next_rebuild = 0.0
        self._last_rebuilt = -1

    def stop(self) -> None:
        """Ask the core for no more."""
        super().stop()
        self._reads.stop()

    def _train(self, minibatches: Minibatches) -> None:
        epoch, N = minibatches.epoch, minibatches.beams_in_log
        self._store.hear_past(minibatches.past)
        if not self._study(epoch, N) or not self._follow(epoch, N) or not self._catch_up(epoch, N):
            return
        if not self._has_teacher:
            self._rebuild_one(epoch, N)
        for beams in minibatches.beams:
            self._clock.spend(1.0)
            if not self._attempt(
                "training step of the teacher", lambda: self._store.teach(epoch, beams, N)
            ):
                return
            self._rebuild_one(epoch, N)

    # What all maps have in common

    def _study(self, epoch: int, N: int) -> bool:
        """Whether the maps may take beams in, after what is to be learned of them is learned."""
        due = self._group.study_due(N)
        if due is not None:
            first, size = due
            read = self._reads.submit(self._core.read, [0], first, size)
            answer = read.result() if self._is_here(read, patiently=True) else None
            if answer is None or answer.epoch != epoch:
                return False
            self._attempt("studying the log's beams", lambda: self._learn(answer.beams))
        return self._group.studied

    def _learn(self, block: LogBlock) -> bool:
        self._group.study(block.placed(0))
        return True

    # Corrections of the histories

    def _follow(self, epoch: int, N: int) -> bool:
        """All maps anew, as the corrected histories have them, while the old ones stay in use.

        With the log's first N beams; what comes meanwhile is new to these maps, and is taken in as
        such. false: not yet, as in `_catch_up`.
        """
        past, particles = self._store.newest_past, self._store.own
        if not self._store.lagging():
            return True
        share = self._affordable_share(particles, epoch, N)
        if share is None:
            return False
        new = Refolding(self._group, particles, share)
        blocks = min(REFOLD_BLOCKS, max(1, LARGEST_READ // (len(particles) * BLOCK_BEAMS)))
        while new.next_beam < N:
            read = self._reads.submit(
                self._core.read, particles, new.next_beam, blocks * BLOCK_BEAMS
            )
            answer = read.result() if self._is_here(read, patiently=True) else None
            if answer is None or answer.epoch != epoch:
                return False
            self._store.hear_past(answer.past)
            if answer.past != past:  # begin again
                return False
            if not self._fold(new, epoch, answer.beams):
                return False
        return self._attempt(
            "exchanging the maps",
            lambda: self._store.exchange(epoch, past, new.maps),
            if_it_fails=False,
        )

    def _affordable_share(self, particles: list[int], epoch: int, N: int) -> float | None:
        """The share of the log's N beams that all maps are made of anew; none: as `_follow`.

        As for a rebuild, but less where most histories differ, so that all maps together cost no
        more than a few rebuilds.
        """
        if not self._rebuild_beams:
            return 1.0
        histories = 0
        for part in PROBED_PARTS:
            read = self._reads.submit(self._core.read, particles, int(part * N), 1)
            answer = read.result() if self._is_here(read, patiently=True) else None
            if answer is None or answer.epoch != epoch:
                return None
            histories += len({row.tobytes() for row in answer.beams.poses})
        mean_histories = histories / len(PROBED_PARTS)
        return min(1.0, self._rebuild_beams / N * min(1.0, FOLLOWING_REBUILDS / mean_histories))

    def _fold(self, new: Refolding, epoch: int, block: LogBlock) -> bool:
        """As if the beams had come one block after the other; false: it is of no use any more."""
        folded_before = new.folded
        for step in new.steps(block, BLOCK_BEAMS):
            if not self._attempt(
                "following corrected histories",
                lambda: self._store.aside(epoch, step),
                if_it_fails=False,
            ):
                return False
        self._clock.spend((new.folded - folded_before) / BLOCK_BEAMS)
        return True

    # New beams

    def _catch_up(self, epoch: int, N: int) -> bool:
        """The log's first N beams into every map, as far as they have come.

        false: the core or its epoch has gone.
        """
        while self._block is not None or self._clock.now() >= self._next_read:
            if self._block is None and not self._ask_for_block(N):
                self._next_read = self._clock.now() + self._read_period
                return True
            # If there is a teacher, it goes on while beams are on their way.
            if not self._is_here(self._block, patiently=not self._has_teacher):
                return True
            block, self._block = self._block, None
            if not self._take_in(block.result(), epoch):
                self._asked_for = []
                return False
        return True

    def _ask_for_block(self, N: int) -> bool:
        """The next block of beams, for the maps that are furthest behind; false: there is none."""
        behind = self._store.behind(N)
        # Maps that take in nothing must not hold up the others.
        self._stuck.update(p for p in self._asked_for if behind.get(p) == self._first)
        waiting = {p: first for p, first in behind.items() if p not in self._stuck}
        if waiting:
            self._first = min(waiting.values())
            self._asked_for = [p for p, first in waiting.items() if first == self._first]
            self._block = self._reads.submit(
                self._core.read, self._asked_for, self._first, BLOCK_BEAMS
            )
        else:
            self._asked_for, self._stuck = [], set()
        return bool(waiting)

    def _is_here(self, future: Future, patiently: bool) -> bool:
        """Whether a reply has come; patiently: wait for it, unless something else comes."""
        while patiently and not (
            future.done() or self._store.frozen or self._store.superseded or rospy.is_shutdown()
        ):
            wait([future], IDLE_S)
            self._between_steps()
        return future.done()

    def _take_in(self, answer: Answer[LogBlock] | None, epoch: int) -> bool:
        """The block into the maps that lack it; false as in `_catch_up`, or by another past."""
        if answer is None or answer.epoch != epoch:
            return False
        self._store.hear_past(answer.past)
        if answer.past != self._store.newest_past or self._store.lagging():
            return False
        block, at_once = answer.beams, self._group.maps_at_once
        for start in range(0, len(self._asked_for), at_once):
            particles = self._asked_for[start : start + at_once]
            rows = block.rows(range(start, start + len(particles)))
            self._clock.spend(len(particles) * len(block) / BLOCK_BEAMS)
            if not self._attempt(
                f"taking in beams of particle {', '.join(map(str, particles))}",
                lambda: self._store.take_in(particles, epoch, self._first, rows),
            ):
                return False
        return True

    # Rebuilding

    def _rebuild_one(self, epoch: int, N: int) -> None:
        """One map anew, if it is outdated, and enough has been done since the last."""
        if self._sample is None:
            outdated = self._store.outdated() if self._clock.now() >= self._next_rebuild else []
            if not outdated:
                return
            # In turn, so that each gets its own.
            self._last_rebuilt = min(outdated, key=lambda p: (p <= self._last_rebuilt, p))
            self._sample = self._reads.submit(self._read_sample, self._last_rebuilt, N)
        if not self._sample.done():
            return
        future, self._sample = self._sample, None
        sample = future.result()
        if sample is None or sample.epoch != epoch:
            return
        self._store.hear_past(sample.past)
        if not self._store.lagging():
            self._rebuild(self._last_rebuilt, sample)

    def _rebuild(self, particle: int, sample: Answer[np.ndarray]) -> None:
        """A map from all beams of the log, or from as many as a rebuild wants of them."""
        start = self._clock.now()
        beams = sample.beams
        self._clock.spend(1.0 + len(beams) / BLOCK_BEAMS)
        self._attempt(
            f"rebuilding the map of particle {particle}",
            lambda: self._store.rebuild(particle, sample.epoch, beams, sample.beams_in_log),
        )
        pause = (self._clock.now() - start) * (1.0 / REBUILD_SHARE - 1.0)
        self._next_rebuild = self._clock.now() + pause

    def _read_sample(self, particle: int, N: int) -> Answer[np.ndarray] | None:
        """Beams that stand for the log as it was then."""
        if N > self._rebuild_beams:
            return self._core.sample(particle, self._rebuild_beams)
        whole = self._core.read([particle], 0, N)
        if whole is None:
            return None
        return replace(whole, beams_in_log=len(whole.beams), beams=whole.beams.placed(0))


def _make_feed(store: MapStore, group: MapGroup, end_turn: EndTurn | None) -> Feed:
    """Minibatches for the teacher, one particle after the other; without one, the log's length."""

    def epoch() -> int:
        return store.epoch

    if group.teacher is not None:
        round_robin = itertools.cycle(store.own)
        request = (lambda: [next(round_robin)], group.minibatch_size, epoch)
        if end_turn is None:
            return MinibatchFeed(*request)
        return TurnFeed(*request, per_round=len(store.own), end_turn=end_turn)
    if end_turn is None:
        return LogFeed(epoch, READ_PERIOD_S)
    # No minibatches: every turn consists of the one reply that tells how long the log is.
    return TurnFeed(lambda: [], 1, epoch, per_round=0, end_turn=end_turn)
