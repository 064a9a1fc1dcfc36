"""Fetches beams from the core: minibatches ahead of the training, and the log in its order.

The log is that of all beams, less the pings held out for the evaluation and those *held back*:
pings that are too young to be mapped (mapping/hold_back_s), since a ping must not be matched with
its own neighbours. Under an offline replay minibatches are not asked for ahead, but in turns: see
turns.py.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from concurrent.futures import Future, wait
from dataclasses import dataclass, replace
from typing import Any, Callable, Generic, Protocol, Sequence, TypeVar

import numpy as np
import rospy

from rbpf_svgp_slam.map_node.background import Background
from rbpf_svgp_slam.maps.log_block import POSE, LogBlock
from rbpf_svgp_slam.protocol import names
from rbpf_svgp_slam.protocol.payload import BadRequest, unpack, unpack_records
from rbpf_svgp_slam.srv import GetBeams, GetBeamsResponse, GetMinibatches, GetMinibatchesResponse

Content = TypeVar("Content")

# Pause between two questions to a core that has no beams yet.
EMPTY_LOG_PAUSE_S = 0.25
# Pause between two attempts to reach a core that is not there: the first, doubled up to the second.
BACK_OFF_S = (0.2, 2.0)
WARNING_PERIOD_S = 30.0
# Several rounds are asked for at once as long as their beams are no more than this: at 1000 beams
# some 80 minibatches, a second of training.
LARGEST_REPLY_BYTES = 1_000_000


@dataclass(frozen=True)
class Minibatches:
    """One reply of the core: a minibatch for each particle that was asked for.

    Both epochs count the resamplings committed (see resampling_phases.py).
    """

    asked_epoch: int  # the node's own when it asked
    epoch: int  # the core's when it placed the beams
    resampling: bool  # a resampling is under way at the core
    past: int  # corrections of the histories that placed them
    beams_in_log: int  # N
    beams: np.ndarray  # [P, M, 3] m, x and y relative to the survey origin
    survey: int = 0  # the core's token: see FilterStatus


class Feed(Protocol):
    """Where training has its minibatches from."""

    def take(self, timeout_s: float) -> Minibatches | None:
        """The next ones; none if there are none within the timeout."""

    def refresh(self) -> None:
        """Let the next reply be one to a question asked from now on."""

    def stop(self) -> None:
        """Ask for no more."""


class PersistentService:
    """A service of the core over one connection, which is made anew after a call that failed."""

    def __init__(self, name: str, service_class: type) -> None:
        self._name = name
        self._service_class = service_class
        self._proxy: rospy.ServiceProxy | None = None

    def __call__(self, *request: Any) -> Any:
        """The response; raises whatever keeps it from coming."""
        try:
            if self._proxy is None:
                # Wait first: connecting to a core that has gone logs a traceback every time.
                rospy.wait_for_service(self._name, timeout=BACK_OFF_S[1])
                self._proxy = rospy.ServiceProxy(self._name, self._service_class, persistent=True)
            return self._proxy(*request)
        except Exception:
            proxy, self._proxy = self._proxy, None
            if proxy is not None:
                proxy.close()
            raise


class MinibatchClient:
    """Asks the core for minibatches and waits for the answer; not to be shared by threads."""

    def __init__(self, size: int, epoch: Callable[[], int]) -> None:
        """size: beams of a minibatch; epoch: the node's own."""
        self._size = size
        self._epoch = epoch
        self._service = PersistentService(names.GET_MINIBATCHES, GetMinibatches)

    def ask(self, particles: Sequence[int]) -> Minibatches | None:
        """One call; none while the core has no minibatches to give."""
        asked_epoch = self._epoch()
        response: GetMinibatchesResponse = self._service(particles, self._size)
        if not response.success:
            rospy.loginfo_throttle(WARNING_PERIOD_S, "waiting for beams: %s", response.message)
            return None
        shape = (len(particles), self._size, 3)
        return Minibatches(
            asked_epoch=asked_epoch,
            epoch=response.epoch,
            resampling=response.resampling,
            past=response.past,
            beams_in_log=response.beams_in_log,
            beams=unpack("beams", response.beams, shape),
            survey=response.survey,
        )


class MinibatchFeed:
    """A thread that keeps a reply ready, so that training need not wait for the network.

    A *round* is a minibatch for each of some particles: for each of a node's, if every map learns
    from its own. A reply holds some rounds, twice as many as before whenever training has used up
    one reply before the next was there.
    """

    def __init__(
        self, particles: Callable[[], Sequence[int]], size: int, epoch: Callable[[], int]
    ) -> None:
        """particles: called for each round, for whom to ask; epoch: the node's own."""
        self._particles = particles
        self._client = MinibatchClient(size, epoch)
        self._rounds_per_reply = 1
        self._in_use: deque[Minibatches] = deque()  # rounds
        self._ready: list[Minibatches] = []  # rounds of the next reply
        self._steady = False  # training goes from one reply to the next
        self._tickets = 0  # rises when replies to earlier questions are not wanted any more
        self._changed = threading.Condition()
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, name="minibatches", daemon=True)
        self._thread.start()

    def take(self, timeout_s: float) -> Minibatches | None:
        """The next round; none if there is none within the timeout."""
        with self._changed:
            if not self._in_use and not self._next_reply(timeout_s):
                return None
            return self._in_use.popleft()

    def refresh(self) -> None:
        """Let the next reply be one to a question asked from now on."""
        with self._changed:
            self._tickets += 1
            self._in_use.clear()
            self._ready = []
            self._steady = False
            self._changed.notify_all()

    def stop(self) -> None:
        """End the thread, unless it is stuck in a call."""
        self._stopped.set()
        with self._changed:
            self._changed.notify_all()
        self._thread.join(timeout=0.5)

    def _next_reply(self, timeout_s: float) -> bool:
        late = self._steady and not self._ready
        self._changed.wait_for(lambda: self._ready, timeout_s)
        if not self._ready:
            return False
        if late:
            self._ask_for_more(self._ready[0].beams.nbytes)
        self._in_use.extend(self._ready)
        self._ready, self._steady = [], True
        self._changed.notify_all()
        return True

    def _ask_for_more(self, round_bytes: int) -> None:
        rounds = 2 * self._rounds_per_reply
        if rounds * round_bytes <= LARGEST_REPLY_BYTES:
            self._rounds_per_reply = rounds
            rospy.logdebug("minibatches came late: from now on %d rounds at once", rounds)

    def _run(self) -> None:
        back_off_s = BACK_OFF_S[0]
        while self._wait_for_demand():
            ticket = self._tickets
            try:
                rounds = self._ask()
                back_off_s = BACK_OFF_S[0]
            except BadRequest as error:
                rospy.logwarn_throttle(WARNING_PERIOD_S, "minibatches refused: %s", error)
                rounds = []
            except Exception as error:  # whatever it is: without this thread there is no training
                if self._stopped.is_set() or rospy.is_shutdown():
                    return
                rospy.logwarn_throttle(WARNING_PERIOD_S, "no minibatches: %s", error)
                self._stopped.wait(back_off_s)
                back_off_s = min(2 * back_off_s, BACK_OFF_S[1])
                continue
            if not rounds:
                self._stopped.wait(EMPTY_LOG_PAUSE_S)
                continue
            with self._changed:
                if ticket == self._tickets:
                    self._ready = rounds
                    self._changed.notify_all()

    def _wait_for_demand(self) -> bool:
        with self._changed:
            self._changed.wait_for(lambda: not self._ready or self._stopped.is_set())
        return not self._stopped.is_set()

    def _ask(self) -> list[Minibatches]:
        """A reply by rounds; empty while the core has no minibatches to give."""
        rounds = [list(self._particles()) for _ in range(self._rounds_per_reply)]
        reply = self._client.ask([particle for one in rounds for particle in one])
        if reply is None:
            return []
        return [replace(reply, beams=beams) for beams in np.split(reply.beams, len(rounds))]


class LogFeed:
    """In place of a MinibatchFeed for maps that want none: tells now and then how long the log is.

    Its replies hold no minibatches, but N and the epoch.
    """

    def __init__(self, epoch: Callable[[], int], period_s: float) -> None:
        """epoch: the node's own; period_s: rest after each reply."""
        # No beams, whatever the size, but the core wants one from 1.
        self._client = MinibatchClient(1, epoch)
        self._period_s = period_s
        # A host that has gone may never answer: then the node must not hang with it.
        self._calls = Background("log")
        self._question: Future | None = None
        self._next_s = 0.0  # monotonic

    def take(self, timeout_s: float) -> Minibatches | None:
        """The next reply; none while resting, or if there is none within the timeout."""
        if self._question is None:
            rest_s = self._next_s - time.monotonic()
            if rest_s > 0.0:
                time.sleep(min(rest_s, timeout_s))
                return None
            self._question = self._calls.submit(self._client.ask, [])
        wait([self._question], timeout_s)
        if not self._question.done():
            return None
        question, self._question = self._question, None
        self._next_s = time.monotonic() + self._period_s
        try:
            return question.result()
        except Exception as error:  # whatever it is: the next question may be answered
            if not rospy.is_shutdown():
                rospy.logwarn_throttle(WARNING_PERIOD_S, "no answer from the core: %s", error)
            return None

    def refresh(self) -> None:
        """Let the next reply be one to a question asked from now on."""
        self._question, self._next_s = None, 0.0

    def stop(self) -> None:
        """End the thread, unless it is stuck in a call."""
        self._calls.stop()


@dataclass(frozen=True)
class Answer(Generic[Content]):
    """Beams from the core."""

    epoch: int  # the core's when it placed them
    past: int  # corrections of the histories that placed them
    beams_in_log: int  # N
    beams: Content


class BeamReader:
    """Asks the core and waits for the answer; not to be shared by threads."""

    def __init__(self) -> None:
        self._services = {
            names.GET_BEAMS: PersistentService(names.GET_BEAMS, GetBeams),
            names.GET_MINIBATCHES: PersistentService(names.GET_MINIBATCHES, GetMinibatches),
        }

    def read(self, particles: Sequence[int], first: int, size: int) -> Answer[LogBlock] | None:
        """Up to `size` beams from the log's `first` on, and the particles' poses to place them."""

        def block(response: GetBeamsResponse) -> LogBlock:
            beams_of_ping = np.array(response.beams_of_ping, dtype=int)
            shape = (len(particles), len(beams_of_ping))
            return LogBlock(
                unpack("beams", response.beams, (beams_of_ping.sum(), 3)),
                beams_of_ping,
                unpack_records("poses", response.poses, POSE, shape),
            )

        return self._call(names.GET_BEAMS, block, list(particles), first, size)

    def sample(self, particle: int, size: int) -> Answer[np.ndarray] | None:
        """`size` beams [size, 3], drawn from the whole log."""

        def minibatch(response: GetMinibatchesResponse) -> np.ndarray:
            return unpack("beams", response.beams, (size, 3))

        return self._call(names.GET_MINIBATCHES, minibatch, [particle], size)

    def _call(
        self, name: str, content: Callable[..., Content], *request: object
    ) -> Answer[Content] | None:
        """The response's beams; none, with a warning, if the core is not there or refuses."""
        try:
            response = self._services[name](*request)
        except Exception as error:  # whatever it is: training goes on
            rospy.logwarn_throttle(WARNING_PERIOD_S, "no beams from %s: %s", name, error)
            return None
        if not response.success:
            rospy.logwarn_throttle(WARNING_PERIOD_S, "%s refused: %s", name, response.message)
            return None
        try:
            return Answer(response.epoch, response.past, response.beams_in_log, content(response))
        except BadRequest as error:
            rospy.logerr_throttle(WARNING_PERIOD_S, "answer of %s: %s", name, error)
            return None
