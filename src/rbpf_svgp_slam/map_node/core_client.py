"""Fetches beams from the core: minibatches ahead of the training, and the log in its order.

Under an offline replay minibatches are not asked for ahead, but in turns: see turns.py.
"""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import dataclass, replace
from typing import Any, Callable, Sequence

import numpy as np
import rospy

from rbpf_svgp_slam.protocol import names
from rbpf_svgp_slam.protocol.payload import BadRequest, unpack
from rbpf_svgp_slam.srv import GetBeams, GetBeamsResponse, GetMinibatches, GetMinibatchesResponse

# Between two questions to a core that has no beams yet.
EMPTY_LOG_PAUSE_S = 0.25
# Between two attempts to reach a core that is not there: doubled from the first to the second.
BACK_OFF_S = (0.2, 2.0)
WARNING_PERIOD_S = 30.0
# Of a question for several rounds: at 1000 beams a map some 80 minibatches, a second of training.
LARGEST_REPLY_BYTES = 1_000_000


@dataclass(frozen=True)
class Minibatches:
    """One reply of the core: a minibatch for each of the node's maps."""

    asked_epoch: int  # the node's own when it asked
    epoch: int  # the core's when it placed the beams
    resampling: bool  # a resampling is under way at the core
    beams_in_log: int  # N
    beams: np.ndarray  # [P, M, 3] m, x and y relative to the survey origin


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
                # Connecting blindly to a core that has gone logs a traceback for every attempt.
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
            beams_in_log=response.beams_in_log,
            beams=unpack("beams", response.beams, shape),
        )


class MinibatchFeed:
    """A thread that keeps a reply ready, so that training need not wait for the network.

    A reply holds some rounds, of a minibatch for each map: twice as many as before whenever
    training has used up one before the next was there.
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
            except Exception as error:  # whatever it is: without this thread training would end
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


@dataclass(frozen=True)
class Beams:
    """Beams of several particles, each placed by its own history."""

    epoch: int  # the core's when it placed them
    beams_in_log: int  # N
    beams: list[np.ndarray]  # by particle, [n, 3] m, as in Minibatches


class BeamReader:
    """Asks the core and waits for the answer; not to be shared by threads."""

    def __init__(self) -> None:
        self._services = {
            names.GET_BEAMS: PersistentService(names.GET_BEAMS, GetBeams),
            names.GET_MINIBATCHES: PersistentService(names.GET_MINIBATCHES, GetMinibatches),
        }

    def read(self, particles: Sequence[int], first: Sequence[int], size: int) -> Beams | None:
        """Up to `size` beams for each particle, from its own `first` of the log on."""

        def parts(response: GetBeamsResponse) -> list[np.ndarray]:
            beams = unpack("beams", response.beams, (sum(response.counts), 3))
            return np.split(beams, np.cumsum(response.counts)[:-1])

        return self._call(names.GET_BEAMS, parts, list(particles), list(first), size)

    def sample(self, particle: int, size: int) -> Beams | None:
        """`size` beams, drawn from the whole log."""

        def parts(response: GetMinibatchesResponse) -> list[np.ndarray]:
            return [unpack("beams", response.beams, (size, 3))]

        return self._call(names.GET_MINIBATCHES, parts, [particle], size)

    def _call(self, name: str, parts: Callable, *request: object) -> Beams | None:
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
            return Beams(response.epoch, response.beams_in_log, parts(response))
        except BadRequest as error:
            rospy.logerr_throttle(WARNING_PERIOD_S, "answer of %s: %s", name, error)
            return None
