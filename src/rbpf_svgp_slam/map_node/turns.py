"""Work under an offline replay, which alternates with its map nodes.

A *turn* is what a node does between two pieces of the survey that the replay takes in: the replay
grants it some rounds, a minibatch for each of its maps, the node does them, and tells its state at
the end. Until the next turn it does nothing. So a run depends on nothing but its bag, parameters
and seed.
"""

from __future__ import annotations

import queue
import threading
import time
from typing import Callable, Sequence

import rospy

from rbpf_svgp_slam.map_node.core_client import (
    BACK_OFF_S,
    EMPTY_LOG_PAUSE_S,
    WARNING_PERIOD_S,
    MinibatchClient,
    Minibatches,
    PersistentService,
)
from rbpf_svgp_slam.msg import MapStatus
from rbpf_svgp_slam.protocol import names
from rbpf_svgp_slam.srv import TakeTurn

# Returns the node's exact state; called when it has finished its turn.
EndTurn = Callable[[], MapStatus]


class TurnFeed:
    """In place of a MinibatchFeed: as many minibatches as a turn grants, none asked for ahead."""

    def __init__(
        self,
        particles: Callable[[], Sequence[int]],
        size: int,
        epoch: Callable[[], int],
        per_round: int,
        end_turn: EndTurn,
    ) -> None:
        """particles, size, epoch: as of a MinibatchFeed; per_round: minibatches in a round.

        end_turn: the node's state, to be sent to the replay.
        """
        self._particles = particles
        self._per_round = per_round
        self._end_turn = end_turn
        self._client = MinibatchClient(size, epoch)
        self._left: int | None = 0  # minibatches in this turn; none while waiting for the next
        self._answered = True  # there has been a reply in this turn
        self._turn = 0  # number of the last turn
        self._states: queue.SimpleQueue[MapStatus] = queue.SimpleQueue()
        self._rounds: queue.SimpleQueue[int] = queue.SimpleQueue()
        self._service = PersistentService(names.TAKE_TURN, TakeTurn)
        self._stopped = threading.Event()
        # A thread, since the call lasts as long as the replay is busy.
        threading.Thread(target=self._run, name="turns", daemon=True).start()

    def take(self, timeout_s: float) -> Minibatches | None:
        """The turn's next minibatches; none while others have their turn.

        To be called when all is done that the last ones were for. A turn without rounds consists
        of one reply without minibatches, which tells N.
        """
        if self._left is None:
            try:
                self._left = self._per_round * self._rounds.get(timeout=timeout_s)
            except queue.Empty:
                return None
            self._answered = False
        elif self._left <= 0 and self._answered:
            self._left = None
            self._states.put(self._end_turn())
            return None
        return self._ask()

    def refresh(self) -> None:
        """Nothing is asked for ahead: the next reply is one to a question asked from now on."""

    def stop(self) -> None:
        """Ask for no more turns."""
        self._stopped.set()

    def _ask(self) -> Minibatches | None:
        particles = list(self._particles()) if self._left else []
        try:
            reply = self._client.ask(particles)
        except Exception as error:  # whatever it is: the replay waits for the end of this turn
            rospy.logwarn_throttle(WARNING_PERIOD_S, "no minibatches: %s", error)
            reply = None
        if reply is None:
            time.sleep(EMPTY_LOG_PAUSE_S)
            return None
        self._left -= len(particles)
        self._answered = True
        return reply

    def _run(self) -> None:
        while not self._stopped.is_set():
            status = self._states.get()
            rounds = None
            while rounds is None and not self._stopped.is_set():
                rounds = self._take_turn(status)
            if rounds is not None:
                self._rounds.put(rounds)

    def _take_turn(self, status: MapStatus) -> int | None:
        """Rounds of the next turn, which may be long in coming; none if the call fails."""
        try:
            response = self._service(status, self._turn)
            if response.success:
                self._turn = response.turn
                return response.rounds
            rospy.logwarn_throttle(WARNING_PERIOD_S, "no turn: %s", response.message)
        except Exception as error:  # whatever it is: without this thread the replay would stand
            if rospy.is_shutdown():
                return None
            if not isinstance(error, rospy.ServiceException):  # as at the replay's end
                rospy.logwarn_throttle(WARNING_PERIOD_S, "no turn: %s", error)
        self._stopped.wait(BACK_OFF_S[0])
        return None


class WallClock:
    """Seconds."""

    now = staticmethod(time.monotonic)

    def spend(self, work: float) -> None:
        """Time goes by on its own."""


class WorkClock:
    """Work done so far, in training steps and whole blocks of beams: the same in every run."""

    def __init__(self) -> None:
        self._spent = 0.0

    def now(self) -> float:
        """Work done."""
        return self._spent

    def spend(self, work: float) -> None:
        """Count it."""
        self._spent += work
