"""The maps of one node's particles and the two phases of a resampling; free of ROS."""

from __future__ import annotations

import math
import threading
import time
from dataclasses import dataclass
from typing import Callable, ContextManager, Sequence

import numpy as np

from rbpf_svgp_slam.map_node.step_lock import StepLock
from rbpf_svgp_slam.maps import MapEngine, MapFactory
from rbpf_svgp_slam.protocol.payload import BadRequest
from rbpf_svgp_slam.protocol.shares import share

# (epoch, owner -> particles) to particle -> bytes of its map.
Fetch = Callable[[int, "dict[int, list[int]]"], "dict[int, bytes]"]
# How soon after a failed preparation the core is asked whether the resampling has been given up.
RETRY_S = 1.0


@dataclass
class Moved:
    """What a preparation took from other nodes."""

    maps: int
    bytes: int


@dataclass
class _Resampling:
    """A resampling under way at this node, from freezing to commit or abort."""

    epoch: int  # that it leads to
    generation: dict[int, MapEngine] | None = None  # the maps it leads to, once they are all here
    ask_at_s: float = math.inf  # monotonic; the core is asked for the outcome from then on


class _EpochOver(Exception):
    """A piece of training has been overtaken by a resampling."""


class MapStore:
    """Maps by particle. Training steps and requests may come from different threads.

    Two locks, always taken in this order: `_lock` keeps the maps from being used by two threads at
    once and is held for one step or one request; `_state` guards the resampling and is held for
    moments only. Neither is held while maps are fetched: the peers fetch from here at that time.
    """

    def __init__(self, index: int, particles: int, nodes: int, factory: MapFactory) -> None:
        self.shares = [share(particles, nodes, node) for node in range(nodes)]
        self.own = self.shares[index]
        self.epoch = 0
        self.steps = 0
        self.skipped_steps = 0
        self._particles = particles
        self._factory = factory
        self._maps = {particle: factory.create() for particle in self.own}
        self._lock = StepLock()
        self._state = threading.Condition()
        self._resampling: _Resampling | None = None

    # Training

    def train(self, particle: int, epoch: int, beams: np.ndarray, beams_in_log: int) -> bool:
        """One step of one map on beams [M, 3]; false if the maps are not of that epoch any more."""
        return self._work(epoch, particle, lambda engine: engine.train_step(beams, beams_in_log))

    def teach(self, epoch: int, beams: np.ndarray, beams_in_log: int) -> bool:
        """One step of the teacher on beams [M, 3]; false as above."""
        return self._work(epoch, None, lambda teacher: teacher.train_step(beams, beams_in_log))

    def behind(self, beams_in_log: int) -> dict[int, int]:
        """Next beam by particle, of the maps that take in every beam and have not all of them."""
        next_beams = {particle: engine.next_beam for particle, engine in self._maps.items()}
        return {particle: first for particle, first in next_beams.items() if first < beams_in_log}

    def take_in(self, particle: int, epoch: int, first: int, beams: np.ndarray) -> bool:
        """Beams [n, 3] from the log's `first` on into one map; false as above."""

        def work(engine: MapEngine) -> None:
            if engine.next_beam == first:
                engine.take_in(beams)

        return self._work(epoch, particle, work)

    def outdated(self) -> list[int]:
        """Particles whose maps are to be rebuilt."""
        return [particle for particle, engine in self._maps.items() if engine.outdated]

    def rebuild(self, particle: int, epoch: int, beams: np.ndarray, beams_in_log: int) -> bool:
        """One map again, from a sample [n, 3] of the log's beams; false as above.

        That takes long: requests are let in between. A resampling among them ends it, without
        effect.
        """

        def pause() -> None:
            self._lock.give_way()
            if not self._trains(epoch):
                raise _EpochOver

        return self._work(
            epoch, particle, lambda engine: engine.rebuild(beams, beams_in_log, pause)
        )

    def _work(self, epoch: int, particle: int | None, work: Callable[[MapEngine], None]) -> bool:
        """A piece of training, between two requests, unless the maps are of another epoch."""
        with self.turn():
            if not self._trains(epoch):
                return False
            engine = self._factory.teacher if particle is None else self._maps[particle]
            skipped_before = engine.skipped_steps
            try:
                work(engine)
            except _EpochOver:
                return False
            except Exception:
                self.skipped_steps += 1
                raise
            skipped = engine.skipped_steps - skipped_before
            self.skipped_steps += skipped
            self.steps += 1 - skipped
        return True

    def _trains(self, epoch: int) -> bool:
        """The maps are of that epoch, and no resampling is under way."""
        return self._resampling is None and epoch == self.epoch

    @property
    def frozen(self) -> bool:
        """No training: a resampling is under way."""
        return self._resampling is not None

    def wait_while_frozen(self, timeout_s: float) -> None:
        """Until the resampling under way is committed or aborted, if it is within the timeout."""
        with self._state:
            self._state.wait_for(lambda: self._resampling is None, timeout_s)

    def adopt(self, epoch: int) -> None:
        """Take over the core's epoch, keeping the maps."""
        with self._lock.request(), self._state:
            self.epoch = epoch
            self._thaw()

    def maps(self) -> dict[int, MapEngine]:
        """The maps by particle, to be looked at by the thread that trains them."""
        return self._maps

    def snapshot(self, particle: int) -> MapEngine:
        """An independent copy of a map, which training leaves alone; to be used in one's `turn`."""
        with self.turn():
            return self._factory.load_alone(self._maps[particle].to_bytes())

    def turn(self) -> ContextManager[None]:
        """To be held while a map is worked with: maps may share their work space."""
        return self._lock.step()

    # Requests

    def predict(
        self, epoch: int, particles: Sequence[int], positions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Each map at its own positions [P, n, 2], m, relative to the survey origin.

        Returns latent mean [P, n], m, and variance [P, n], and the maps' prior variance [P], m².
        """
        mean, variance = np.empty((2, *positions.shape[:2]), dtype=np.float32)
        prior = np.empty(len(particles), dtype=np.float32)
        with self._lock.request():
            if epoch != self.epoch:
                raise BadRequest(f"epoch is {epoch}; expected {self.epoch}, this node's")
            self._check_owned(particles)
            for row, particle in enumerate(particles):
                engine = self._maps[particle]
                mean[row], variance[row] = engine.predict(positions[row])
                prior[row] = engine.prior_variance_m2
        finite = np.isfinite(mean).all(1) & np.isfinite(variance).all(1)
        if not finite.all():
            particle = particles[int(np.argmin(finite))]
            raise BadRequest(f"prediction of particle {particle} is not finite; expected finite")
        return mean, variance, prior

    def serialise(
        self, epoch: int | None, particles: Sequence[int], timeout_s: float
    ) -> list[bytes]:
        """Whole maps as they are in this epoch, or as they will be when frozen for the next one.

        epoch none: as they are, in whatever epoch.
        """
        self._check_owned(particles)
        if epoch not in (None, self.epoch):
            self._wait_until_frozen(epoch, timeout_s)
        with self._lock.request():
            if epoch not in (None, self.epoch) and not self._is_frozen_for(epoch):
                raise BadRequest(f"epoch is {epoch}; expected {self.epoch}, this node's")
            return [self._maps[particle].to_bytes() for particle in particles]

    # Resampling, phase one

    def prepare(
        self, epoch: int, ancestors: Sequence[int], fetch: Fetch, timeout_s: float
    ) -> Moved:
        """Stop training and get everything ready for maps[j] = maps[ancestors[j]].

        If neither commit nor abort comes within the timeout, `undecided` turns true.
        """
        attempt = self._freeze(epoch, ancestors)
        try:
            generation, moved = self._next_generation(epoch, ancestors, fetch)
        except Exception:
            # Stays frozen until the core calls it off: other nodes may still be fetching from here.
            attempt.ask_at_s = time.monotonic() + RETRY_S
            raise
        with self._state:
            if self._resampling is not attempt:
                raise BadRequest(
                    f"resampling to epoch {epoch} ended while its maps were being fetched; "
                    "expected it to wait for this node"
                )
            attempt.generation = generation
            attempt.ask_at_s = time.monotonic() + timeout_s
        return moved

    def _freeze(self, epoch: int, ancestors: Sequence[int]) -> _Resampling:
        with self._lock.request(), self._state:
            if epoch != self.epoch + 1:
                raise BadRequest(f"epoch is {epoch}; expected {self.epoch + 1}, this node's + 1")
            if len(ancestors) != self._particles:
                raise BadRequest(
                    f"ancestors has {len(ancestors)} entries; expected {self._particles}"
                )
            for j, ancestor in enumerate(ancestors):
                if not 0 <= ancestor < self._particles:
                    raise BadRequest(
                        f"ancestors[{j}] is {ancestor}; expected 0 .. {self._particles - 1}"
                    )
            # A second plan for an epoch replaces the first, whose abort must have been lost.
            self._resampling = _Resampling(epoch)
            self._state.notify_all()
            return self._resampling

    def _next_generation(
        self, epoch: int, ancestors: Sequence[int], fetch: Fetch
    ) -> tuple[dict[int, MapEngine], Moved]:
        """The maps after the resampling; nobody trains meanwhile. A survivor stays where it is."""
        inherited = {ancestors[j] for j in self.own if ancestors[j] != j}
        wanted = {
            owner: sorted(inherited.intersection(particles))
            for owner, particles in enumerate(self.shares)
            if particles != self.own and inherited.intersection(particles)
        }
        data = fetch(epoch, wanted) if wanted else {}
        moved = Moved(maps=len(data), bytes=sum(map(len, data.values())))
        generation = {}
        for j in self.own:
            # One map at a time, so that predictions need not wait for all of them.
            with self._lock.request():
                generation[j] = self._inherit(j, ancestors[j], data)
        return generation, moved

    def _inherit(self, particle: int, ancestor: int, data: dict[int, bytes]) -> MapEngine:
        if particle == ancestor:
            return self._maps[particle]
        if ancestor in self.own:
            return self._maps[ancestor].copy()
        return self._factory.load(data[ancestor])

    # Resampling, phase two

    def commit(self, epoch: int) -> None:
        """Take the new maps and train on. Repeating it changes nothing."""
        with self._lock.request(), self._state:
            if epoch == self.epoch:
                return
            staged = self._resampling
            if staged is None or staged.epoch != epoch or staged.generation is None:
                raise BadRequest(f"epoch is {epoch}; expected {self._expected_decision()}")
            self._take(staged)

    def abort(self, epoch: int) -> None:
        """Keep the old maps and train on. Repeating it changes nothing."""
        with self._lock.request(), self._state:
            if epoch != self.epoch + 1:
                raise BadRequest(f"epoch is {epoch}; expected {self.epoch + 1}, not yet committed")
            self._thaw()

    def undecided(self) -> bool:
        """The outcome is overdue: the core must be asked."""
        resampling = self._resampling
        return resampling is not None and time.monotonic() >= resampling.ask_at_s

    def settle(self, core_epoch: int, core_resampling: bool) -> str:
        """Act on the core's own state where its decision never came; returns what was done."""
        with self._lock.request(), self._state:
            pending = self._resampling
            if pending is None or not self.undecided():
                return ""
            if core_epoch == pending.epoch and pending.generation is not None:
                self._take(pending)
                return "committed"
            if core_resampling:
                pending.ask_at_s = time.monotonic() + RETRY_S
                return ""
            self._thaw()
            return "aborted"

    # Helpers

    def _take(self, resampling: _Resampling) -> None:
        self._maps = resampling.generation
        self.epoch = resampling.epoch
        self._thaw()

    def _thaw(self) -> None:
        self._resampling = None
        self._state.notify_all()

    def _check_owned(self, particles: Sequence[int]) -> None:
        for particle in particles:
            if particle not in self.own:
                raise BadRequest(
                    f"particle is {particle}; expected {self.own.start} .. {self.own.stop - 1}, "
                    "this node's own"
                )

    def _is_frozen_for(self, epoch: int) -> bool:
        return self._resampling is not None and self._resampling.epoch == epoch

    def _wait_until_frozen(self, epoch: int, timeout_s: float) -> None:
        with self._state:
            if epoch != self.epoch + 1:
                raise BadRequest(f"epoch is {epoch}; expected {self.epoch} or {self.epoch + 1}")
            if not self._state.wait_for(lambda: self._is_frozen_for(epoch), timeout_s):
                raise BadRequest(
                    f"this node has not stopped training for epoch {epoch} within {timeout_s:g} s; "
                    "expected its part of the resampling to be prepared"
                )

    def _expected_decision(self) -> str:
        if self._resampling is None:
            return f"{self.epoch}, nothing is prepared"
        if self._resampling.generation is None:
            return f"{self.epoch}, epoch {self._resampling.epoch} is not fully prepared"
        return f"{self._resampling.epoch}, as prepared"
