"""What a map node does when nobody asks it for anything: train its maps."""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from concurrent.futures import Future
from dataclasses import replace
from typing import Callable, Sequence

import rospy

from rbpf_svgp_slam.map_node.background import AtOnce, Background
from rbpf_svgp_slam.map_node.core_client import BeamReader, Beams, Minibatches, MinibatchFeed
from rbpf_svgp_slam.map_node.map_store import RETRY_S, MapStore
from rbpf_svgp_slam.map_node.turns import EndTurn, TurnFeed, WallClock, WorkClock
from rbpf_svgp_slam.maps import MapFactory

# Longest wait for minibatches, after which the node looks after its other duties.
IDLE_S = 0.1
ERROR_PERIOD_S = 10.0
# Beams of each map that are asked for at once.
BLOCK_BEAMS = 1024
# Live, time between two questions for new beams: a block costs more, per beam, the shorter it is.
READ_PERIOD_S = 0.5
# Largest share of the time that is spent on rebuilding maps.
REBUILD_SHARE = 0.3


class Training(ABC):
    """Minibatches of this node's epoch, and what is done with them."""

    def __init__(
        self,
        store: MapStore,
        particles: Callable[[], Sequence[int]],
        minibatch_size: int,
        between_steps: Callable[[], None],
        end_turn: EndTurn | None,
    ) -> None:
        """particles: whose minibatches are wanted; between_steps: called where others may work.

        end_turn: none if live; under an offline replay, what has become of the node in a turn.
        """
        self._store = store
        self._between_steps = between_steps
        self._outcome_asked = False  # of a resampling whose decision is overdue
        request = (particles, minibatch_size, lambda: store.epoch)
        self._feed: MinibatchFeed | TurnFeed
        if end_turn is None:
            self._feed = MinibatchFeed(*request)
        else:
            self._feed = TurnFeed(*request, maps=len(store.own), end_turn=end_turn)

    def advance(self) -> None:
        """A piece of training, or a short wait."""
        minibatches = self._next_minibatches()
        if minibatches is not None:
            self._train(minibatches)

    def stop(self) -> None:
        """Ask the core for no more."""
        self._feed.stop()

    @abstractmethod
    def _train(self, minibatches: Minibatches) -> None:
        """Use one reply of the core."""

    def _attempt(self, what: str, step: Callable[[], bool]) -> bool:
        """A step of one map, whose failure must not stop the others; false: the epoch is over."""
        goes_on = True
        try:
            goes_on = step()
        except Exception as error:
            rospy.logerr_throttle(ERROR_PERIOD_S, f"{what} failed: {error!r}")
        self._between_steps()
        return goes_on and not rospy.is_shutdown()

    def _next_minibatches(self) -> Minibatches | None:
        """Minibatches of this node's epoch, if there are any at present."""
        if not self._store.frozen:
            reply = self._feed.take(IDLE_S)
            return reply if reply is not None and self._is_current(reply) else None
        if not self._store.undecided():
            self._store.wait_while_frozen(IDLE_S)
            return None
        # The decision is late or lost. Only an answer to a question asked from now on tells which.
        if not self._outcome_asked:
            self._feed.refresh()
            self._outcome_asked = True
        reply = self._feed.take(RETRY_S)
        if reply is None:
            return None
        self._outcome_asked = False
        outcome = self._store.settle(reply.epoch, reply.resampling)
        if outcome:
            rospy.logwarn("a resampling's outcome has not been sent; %s, as the core says", outcome)
        return None

    def _is_current(self, reply: Minibatches) -> bool:
        """Beams placed under another epoch are useless; an epoch that stays another is adopted."""
        epoch = self._store.epoch
        if reply.epoch == epoch:
            return True
        if reply.asked_epoch != epoch:
            self._feed.refresh()  # what is ready behind it has been asked for before, too
            return False
        if reply.resampling or self._store.frozen:
            return False
        if self._store.steps == 0:
            rospy.loginfo("joining at epoch %d, with new maps", reply.epoch)
        else:
            rospy.logerr_throttle(
                ERROR_PERIOD_S,
                f"the core is at epoch {reply.epoch}; expected {epoch}, this node's: "
                "a resampling or the core's start has been missed, the maps stay as they are",
            )
        self._store.adopt(reply.epoch)
        return False


class MinibatchTraining(Training):
    """Every map learns from minibatches of its own, round robin."""

    def __init__(
        self,
        store: MapStore,
        factory: MapFactory,
        between_steps: Callable[[], None],
        end_turn: EndTurn | None = None,
    ) -> None:
        super().__init__(store, lambda: store.own, factory.minibatch_size, between_steps, end_turn)

    def _train(self, minibatches: Minibatches) -> None:
        epoch, N = minibatches.epoch, minibatches.beams_in_log
        for particle, beams in zip(self._store.own, minibatches.beams):
            if not self._attempt(
                f"training step of particle {particle}",
                lambda: self._store.train(particle, epoch, beams, N),
            ):
                return


class StreamTraining(Training):
    """Every map takes in every beam once; a teacher learns from minibatches for all of them.

    The teacher's minibatches are placed by the histories of the node's particles in turn: what it
    learns must not fit one particle better than another.
    """

    def __init__(
        self,
        store: MapStore,
        factory: MapFactory,
        between_steps: Callable[[], None],
        end_turn: EndTurn | None = None,
    ) -> None:
        round_robin = itertools.cycle(store.own)
        super().__init__(
            store, lambda: [next(round_robin)], factory.minibatch_size, between_steps, end_turn
        )
        self._core = BeamReader()
        self._rebuild_beams = factory.rebuild_beams
        # What rebuilding has its share of: the time itself if live, else the work done.
        self._clock = WallClock() if end_turn is None else WorkClock()
        # The teacher goes on while beams are on their way; in turns everything has its order.
        self._reads = Background("beams") if end_turn is None else AtOnce()
        self._blocks: Future | None = None  # next beams of the log, on their way
        self._asked_for: dict[int, int] = {}  # first of them, by particle
        self._sample: Future | None = None  # of the log, for a rebuild, on its way
        self._read_period = READ_PERIOD_S if end_turn is None else 0.0
        self._next_read = 0.0  # by the clock, as the next
        self._next_rebuild = 0.0
        self._last_rebuilt = -1

    def _train(self, minibatches: Minibatches) -> None:
        epoch, N = minibatches.epoch, minibatches.beams_in_log
        if not self._catch_up(epoch, N):
            return
        for beams in minibatches.beams:
            self._clock.spend(1.0)
            if not self._attempt(
                "training step of the teacher", lambda: self._store.teach(epoch, beams, N)
            ):
                return
            self._rebuild_one(epoch, N)

    def _catch_up(self, epoch: int, N: int) -> bool:
        """The log's first N beams into every map, as far as they have come.

        false: the core or its epoch has gone.
        """
        while self._blocks is not None or self._clock.now() >= self._next_read:
            if self._blocks is None and not self._ask_for_blocks(N):
                self._next_read = self._clock.now() + self._read_period
                return True
            if not self._blocks.done():
                return True
            blocks, self._blocks = self._blocks, None
            if not self._take_in_blocks(blocks.result(), epoch):
                self._asked_for = {}
                return False
        return True

    def _ask_for_blocks(self, N: int) -> bool:
        """The next block of beams for every map that is behind; false: there is nothing to do."""
        behind, before = self._store.behind(N), self._asked_for
        # Maps that take in nothing must not hold up the others.
        self._asked_for = {} if behind == before else behind
        if self._asked_for:
            first = list(behind.values())
            self._blocks = self._reads.submit(self._core.read, list(behind), first, BLOCK_BEAMS)
        return bool(self._asked_for)

    def _take_in_blocks(self, reply: Beams | None, epoch: int) -> bool:
        """Every map's block of beams into it; false as above."""
        if reply is None or reply.epoch != epoch:
            return False
        for (particle, first), beams in zip(self._asked_for.items(), reply.beams):
            self._clock.spend(len(beams) / BLOCK_BEAMS)
            if not self._attempt(
                f"taking in beams of particle {particle}",
                lambda: self._store.take_in(particle, epoch, first, beams),
            ):
                return False
        return True

    def _rebuild_one(self, epoch: int, N: int) -> None:
        """One map anew, if the teacher has moved on, and enough has been done since the last."""
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
        if sample is not None and sample.epoch == epoch:
            self._rebuild(self._last_rebuilt, sample)

    def _rebuild(self, particle: int, sample: Beams) -> None:
        """A map from all beams of the log, or from as many as a rebuild wants of them."""
        start = self._clock.now()
        beams = sample.beams[0]
        self._clock.spend(1.0 + len(beams) / BLOCK_BEAMS)
        self._attempt(
            f"rebuilding the map of particle {particle}",
            lambda: self._store.rebuild(particle, sample.epoch, beams, sample.beams_in_log),
        )
        pause = (self._clock.now() - start) * (1.0 / REBUILD_SHARE - 1.0)
        self._next_rebuild = self._clock.now() + pause

    def _read_sample(self, particle: int, N: int) -> Beams | None:
        """Beams that stand for the log as it was then."""
        if N > self._rebuild_beams:
            return self._core.sample(particle, self._rebuild_beams)
        whole = self._core.read([particle], [0], N)
        return None if whole is None else replace(whole, beams_in_log=len(whole.beams[0]))
