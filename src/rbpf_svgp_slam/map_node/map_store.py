"""The maps of one node's particles: training, requests, and copies in a resampling; free of ROS."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Callable, ContextManager, NamedTuple, Sequence

import numpy as np

from rbpf_svgp_slam.map_node.resampling_phases import ResamplingPhases
from rbpf_svgp_slam.map_node.step_lock import StepLock
from rbpf_svgp_slam.maps import MapGroup, SeabedMap
from rbpf_svgp_slam.maps.log_block import LogBlock
from rbpf_svgp_slam.protocol.payload import BadRequest
from rbpf_svgp_slam.protocol.shares import share


class SentMap(NamedTuple):
    """A map from another node."""

    data: bytes
    past: int  # corrections of the histories that it has followed


# Of a prediction: positions a map, and in all. What it takes of memory and of the node's time grows
# with both.
MOST_POINTS, MOST_POSITIONS = 100_000, 2_000_000

# (epoch, owner -> particles) to particle -> its map.
Fetch = Callable[[int, "dict[int, list[int]]"], "dict[int, SentMap]"]


@dataclass
class Fetched:
    """How much a preparation has fetched from other nodes."""

    maps: int
    bytes: int


class _EpochChanged(Exception):
    """A resampling has come in the midst of a step."""


class MapStore:
    """Maps by particle. Training steps and requests may come from different threads.

    A map's *past* is how many corrections of its particle's history it has followed: its beams lie
    where that history, so often corrected, has them.

    Two locks, always taken in this order: `_lock` keeps the maps from being used by two threads at
    once and is held for one step or one request; that of the resampling's phases is held for
    moments only. Neither is held while maps are fetched: the peers fetch from here at that time.
    """

    def __init__(self, index: int, particles: int, nodes: int, group: MapGroup) -> None:
        """index: of this node, 0 .. nodes - 1; particles: of the filter; group: of this node."""
        self.shares = [share(particles, nodes, node) for node in range(nodes)]
        self.own = self.shares[index]
        #: Token of the survey that the maps belong to; 0 before any has been heard of.
        self.survey = 0
        #: Another survey has been heard of: these maps are of no use any more.
        self.superseded = False
        self.steps = 0
        self.skipped_steps = 0
        self._particles = particles
        self._group = group
        self._maps: dict[int, Any] = {particle: group.create() for particle in self.own}
        self._pasts: dict[int, int] = dict.fromkeys(self.own, 0)
        self._newest_past = 0
        self._lock = StepLock()
        self._phases = ResamplingPhases(take_over=self._replace_maps)

    # Surveys

    def hear_survey(self, survey: int) -> bool:
        """Whether the maps are of the core's survey; new ones are of the first that is heard of."""
        self.survey = self.survey or survey
        if survey != self.survey:
            self.superseded = True
        return not self.superseded

    def check_survey(self, survey: int) -> None:
        """Raises BadRequest if a request is of another survey than the maps."""
        if survey != self.survey:
            raise BadRequest(f"survey is {survey:x}; expected {self.survey:x}, this node's")

    # Training. Each of these returns false, without effect, if the beams are of another epoch than
    # the maps, or a resampling is under way.

    def train(self, particle: int, epoch: int, beams: np.ndarray, beams_in_log: int) -> bool:
        """One step of one map on a minibatch of beams [M, 3]."""
        return self._advance(
            [particle], epoch, lambda maps: maps[0].train_step(beams, beams_in_log)
        )

    def teach(self, epoch: int, beams: np.ndarray, beams_in_log: int) -> bool:
        """One step of the teacher on a minibatch of beams [M, 3]."""
        return self._advance(None, epoch, lambda maps: maps[0].train_step(beams, beams_in_log))

    def take_in(self, particles: Sequence[int], epoch: int, first: int, block: LogBlock) -> bool:
        """The log's beams from `first` on into those maps of the particles that lack them.

        block: with poses [P, K] by particle.
        """

        def step(maps: list[Any]) -> None:
            rows = [row for row, one in enumerate(maps) if one.next_beam == first]
            if rows:
                self._group.take_in([maps[row] for row in rows], block.rows(rows))

        return self._advance(particles, epoch, step)

    def rebuild(self, particle: int, epoch: int, beams: np.ndarray, beams_in_log: int) -> bool:
        """One map again, from a sample [n, 3] of the log's beams.

        That takes long: requests are let in between. A resampling among them ends it, without
        effect.
        """

        def pause() -> None:
            self._lock.give_way()
            if not self._phases.allows_training(epoch):
                raise _EpochChanged

        return self._advance(
            [particle], epoch, lambda maps: maps[0].rebuild(beams, beams_in_log, pause)
        )

    def _advance(
        self, particles: Sequence[int] | None, epoch: int, step: Callable[[list[Any]], None]
    ) -> bool:
        """A step of some particles' maps, or of the teacher, between two requests."""
        with self.exclusive():
            if not self._phases.allows_training(epoch):
                return False
            if particles is None:
                trained = [self._group.teacher]
            else:
                trained = [self._maps[particle] for particle in particles]
            skipped_before = sum(one.skipped_steps for one in trained)
            try:
                step(trained)
            except _EpochChanged:
                return False
            except Exception:
                self.skipped_steps += len(trained)
                raise
            skipped = sum(one.skipped_steps for one in trained) - skipped_before
            self.skipped_steps += skipped
            self.steps += len(trained) - skipped
        return True

    def behind(self, beams_in_log: int) -> dict[int, int]:
        """Next beam by particle, of the maps that have not taken in all of the log's beams."""
        next_beams = {particle: one.next_beam for particle, one in self._maps.items()}
        return {particle: first for particle, first in next_beams.items() if first < beams_in_log}

    def outdated(self) -> list[int]:
        """Particles whose maps are to be rebuilt."""
        return [particle for particle, one in self._maps.items() if one.outdated]

    def maps(self) -> dict[int, Any]:
        """The maps by particle, to be looked at by the thread that trains them."""
        return self._maps

    def snapshot(self, particle: int) -> SeabedMap:
        """An independent copy of a map, which training leaves alone; see `exclusive`."""
        with self.exclusive():
            return self._group.load_alone(self._maps[particle].to_bytes())

    def exclusive(self) -> ContextManager[None]:
        """To be held while a map or a copy is used: all of them may share work space."""
        return self._lock.step()

    # Corrections of the histories

    @property
    def newest_past(self) -> int:
        """The core's, as far as it is known here."""
        return self._newest_past

    @property
    def past(self) -> int:
        """That all maps have followed."""
        return min((self._pasts[particle] for particle in self.lagging()), default=self.newest_past)

    def lagging(self) -> list[int]:
        """Particles whose maps have not followed the newest past."""
        return [particle for particle, past in self._pasts.items() if past != self._newest_past]

    def hear_past(self, past: int) -> None:
        """A past of the core; maps without a beam have followed it at once."""
        if past <= self._newest_past and not self.lagging():
            return
        with self.exclusive():
            self._newest_past = max(past, self._newest_past)
            for particle, one in self._maps.items():
                if one.next_beam == 0:
                    self._pasts[particle] = self._newest_past

    def follow_at_once(self, past: int) -> None:
        """A past of the core, for maps that forget what they have learned."""
        if past <= self._newest_past and not self.lagging():
            return
        with self.exclusive():
            self._newest_past = max(past, self._newest_past)
            self._pasts = dict.fromkeys(self.own, self._newest_past)

    def aside(self, epoch: int, step: Callable[[], None]) -> bool:
        """A step on maps that are not in use yet, between two requests; false as for training."""
        return self._advance([], epoch, lambda maps: step())

    def exchange(self, epoch: int, past: int, make: Callable[[], dict[int, Any]]) -> bool:
        """All maps for those that are made, which have followed that past; false as above."""

        def exchange() -> None:
            maps = make()
            for particle, one in maps.items():
                one.iterations += self._maps[particle].iterations
            self._maps, self._pasts = maps, dict.fromkeys(maps, past)

        return self.aside(epoch, exchange)

    # Requests

    def predict(
        self, epoch: int, particles: Sequence[int], positions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Each map at its own positions [P, n, 2], m, relative to the survey origin.

        Returns latent mean [P, n], m, and variance [P, n], and the maps' prior variance [P], m².
        """
        points = positions.shape[1]
        if points > MOST_POINTS or points * len(particles) > MOST_POSITIONS:
            raise BadRequest(
                f"request is for {points} points of {len(particles)} particles; expected at most "
                f"{MOST_POINTS} points of each and {MOST_POSITIONS} in all"
            )
        mean, variance = np.empty((2, *positions.shape[:2]), dtype=np.float32)
        prior = np.empty(len(particles), dtype=np.float32)
        with self._lock.request():
            if epoch != self.epoch:
                raise BadRequest(f"epoch is {epoch}; expected {self.epoch}, this node's")
            self._check_owned(particles)
            asked = [self._maps[particle] for particle in particles]
            for row, predicted in enumerate(self._group.predict(asked, positions)):
                mean[row], variance[row] = predicted
            prior[:] = [one.prior_variance_m2 for one in asked]
        finite = np.isfinite(mean).all(1) & np.isfinite(variance).all(1)
        if not finite.all():
            particle = particles[int(np.argmin(finite))]
            raise BadRequest(f"prediction of particle {particle} is not finite; expected finite")
        return mean, variance, prior

    def serialise(
        self,
        epoch: int | None,
        particles: Sequence[int],
        timeout_s: float,
        known: bytes | None = None,
    ) -> list[bytes]:
        """Maps as they are in this epoch, or as they will be when frozen for the next one.

        epoch none: as they are, in whatever epoch; known: what another node has of them already
        (MapGroup.serialise), none: whole maps.
        """
        self._check_owned(particles)
        if epoch not in (None, self.epoch):
            self._phases.wait_until_frozen_for(epoch, timeout_s)
        with self._lock.request():
            if epoch not in (None, self.epoch) and not self._phases.is_frozen_for(epoch):
                raise BadRequest(f"epoch is {epoch}; expected {self.epoch}, this node's")
            maps = [self._maps[particle] for particle in particles]
            if known is None:
                return [one.to_bytes() for one in maps]
            return self._group.serialise(maps, known)

    def hand_over(
        self, epoch: int, particles: Sequence[int], timeout_s: float, known: bytes
    ) -> tuple[list[bytes], list[int]]:
        """Maps as of `serialise` and their pasts, for another node."""
        self._check_owned(particles)
        # Read before the maps: what is older than they are is followed once more, which does no
        # harm.
        pasts = [self._pasts[particle] for particle in particles]
        return self.serialise(epoch, particles, timeout_s, known), pasts

    def known_pieces(self) -> bytes:
        """What the other nodes need not send: see `serialise`."""
        with self._lock.request():
            return self._group.known_pieces()

    def _check_owned(self, particles: Sequence[int]) -> None:
        for particle in particles:
            if particle not in self.own:
                raise BadRequest(
                    f"particle is {particle}; expected {self.own.start} .. {self.own.stop - 1}, "
                    "this node's own"
                )
        if len(set(particles)) < len(particles):
            raise BadRequest(f"{len(particles)} particles, not all different; expected each once")

    # Resampling

    @property
    def epoch(self) -> int:
        """Of the maps: resamplings committed."""
        return self._phases.epoch

    @property
    def frozen(self) -> bool:
        """No training: a resampling is under way."""
        return self._phases.frozen

    def wait_while_frozen(self, timeout_s: float) -> None:
        """Until the resampling under way is committed or aborted, if it is within the timeout."""
        self._phases.wait_while_frozen(timeout_s)

    def prepare(
        self, epoch: int, ancestors: Sequence[int], fetch: Fetch, timeout_s: float
    ) -> Fetched:
        """First phase: stop training, and get everything ready for maps[j] = maps[ancestors[j]].

        If neither commit nor abort comes within the timeout, `undecided` turns true.
        """
        with self._lock.request():
            self._phases.expect_next(epoch)
            self._check_plan(ancestors)
            attempt = self._phases.freeze(epoch)
        try:
            after, fetched = self._maps_after(epoch, ancestors, fetch)
        except Exception:
            self._phases.fail_preparation(attempt)
            raise
        self._phases.finish_preparation(attempt, after, timeout_s)
        return fetched

    def commit(self, epoch: int) -> None:
        """Second phase: take the new maps and train on. Repeating it changes nothing."""
        with self._lock.request():
            self._phases.commit(epoch)

    def abort(self, epoch: int) -> None:
        """Second phase: keep the old maps and train on. Repeating it changes nothing."""
        with self._lock.request():
            self._phases.abort(epoch)

    def undecided(self) -> bool:
        """The core's decision is overdue: it must be asked."""
        return self._phases.undecided()

    def settle(self, core_epoch: int, core_resampling: bool) -> str:
        """Act on the core's own state where its decision never came; returns what was done."""
        with self._lock.request():
            return self._phases.settle(core_epoch, core_resampling)

    def adopt(self, epoch: int) -> None:
        """Take over the core's epoch, keeping the maps."""
        with self._lock.request():
            self._phases.adopt(epoch)
            self._newest_past = 0

    def _check_plan(self, ancestors: Sequence[int]) -> None:
        if len(ancestors) != self._particles:
            raise BadRequest(f"ancestors has {len(ancestors)} entries; expected {self._particles}")
        for j, ancestor in enumerate(ancestors):
            if not 0 <= ancestor < self._particles:
                raise BadRequest(
                    f"ancestors[{j}] is {ancestor}; expected 0 .. {self._particles - 1}"
                )

    def _maps_after(
        self, epoch: int, ancestors: Sequence[int], fetch: Fetch
    ) -> tuple[dict[int, Any], Fetched]:
        """Map and past by particle after the resampling; nobody trains meanwhile.

        A survivor stays where it is.
        """
        inherited = {ancestors[j] for j in self.own if ancestors[j] != j}
        wanted = {
            owner: sorted(inherited.intersection(particles))
            for owner, particles in enumerate(self.shares)
            if particles != self.own and inherited.intersection(particles)
        }
        data = fetch(epoch, wanted) if wanted else {}
        fetched = Fetched(maps=len(data), bytes=sum(len(one.data) for one in data.values()))
        # One map at a time, so that predictions need not wait for all of them.
        ancestral = {}
        for owner in sorted(wanted):
            for ancestor in wanted[owner]:  # in the order in which they have been serialised
                with self._lock.request():
                    ancestral[ancestor] = self._group.load(data[ancestor].data)
        pasts = {**{particle: one.past for particle, one in data.items()}, **self._pasts}
        after = {}
        for j in self.own:
            with self._lock.request():
                after[j] = self._inherit(j, ancestors[j], ancestral), pasts[ancestors[j]]
        return after, fetched

    def _inherit(self, particle: int, ancestor: int, ancestral: dict[int, Any]) -> Any:
        """ancestral: maps that have come from other nodes."""
        if particle == ancestor:
            return self._maps[particle]
        return (self._maps if ancestor in self.own else ancestral)[ancestor].copy()

    def _replace_maps(self, after: dict[int, tuple[Any, int]]) -> None:
        self._maps = {particle: one for particle, (one, _) in after.items()}
        self._pasts = {particle: past for particle, (_, past) in after.items()}
        # Another node may have heard of a newer one.
        self._newest_past = max(self._newest_past, *self._pasts.values())
