"""Fetches minibatches from the core ahead of the training that uses them."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import Callable, Sequence

import numpy as np
import rospy

from rbpf_svgp_slam.ros.payload import BadRequest, unpack
from rbpf_svgp_slam.srv import GetMinibatches, GetMinibatchesResponse

SERVICE = "rbpf_core/get_minibatches"
# Between two questions to a core that has no beams yet.
EMPTY_LOG_PAUSE_S = 0.25
# Between two attempts to reach a core that is not there: doubled from the first to the second.
BACK_OFF_S = (0.2, 2.0)
WARNING_PERIOD_S = 30.0


@dataclass(frozen=True)
class Minibatches:
    """One reply of the core: a minibatch for each of the node's maps."""

    asked_epoch: int  # the node's own when it asked
    epoch: int  # the core's when it placed the beams
    resampling: bool  # a resampling is under way at the core
    beams_in_log: int  # N
    beams: np.ndarray  # [P, M, 3] m, x and y relative to the survey origin


class MinibatchFeed:
    """A thread that keeps exactly one reply ready, so that training never waits for the network."""

    def __init__(self, particles: Sequence[int], size: int, epoch: Callable[[], int]) -> None:
        self._particles = list(particles)
        self._size = size
        self._epoch = epoch
        self._ready: Minibatches | None = None
        self._tickets = 0  # rises when replies to earlier questions are not wanted any more
        self._changed = threading.Condition()
        self._stopped = threading.Event()
        self._proxy: rospy.ServiceProxy | None = None
        self._thread = threading.Thread(target=self._run, name="minibatches", daemon=True)
        self._thread.start()

    def take(self, timeout_s: float) -> Minibatches | None:
        """The reply that is ready, or the next one; none if there is none within the timeout."""
        with self._changed:
            self._changed.wait_for(lambda: self._ready is not None, timeout_s)
            reply, self._ready = self._ready, None
            self._changed.notify_all()
            return reply

    def refresh(self) -> None:
        """Let the next reply be one to a question asked from now on."""
        with self._changed:
            self._tickets += 1
            self._ready = None
            self._changed.notify_all()

    def stop(self) -> None:
        """End the thread, unless it is stuck in a call."""
        self._stopped.set()
        with self._changed:
            self._changed.notify_all()
        self._thread.join(timeout=0.5)

    def _run(self) -> None:
        back_off_s = BACK_OFF_S[0]
        while self._wait_for_demand():
            ticket = self._tickets
            try:
                reply = self._ask()
                back_off_s = BACK_OFF_S[0]
            except BadRequest as error:
                rospy.logwarn_throttle(WARNING_PERIOD_S, "minibatches refused: %s", error)
                reply = None
            except Exception as error:  # whatever it is: without this thread training would end
                self._disconnect()
                if self._stopped.is_set() or rospy.is_shutdown():
                    return
                rospy.logwarn_throttle(WARNING_PERIOD_S, "no minibatches: %s", error)
                self._stopped.wait(back_off_s)
                back_off_s = min(2 * back_off_s, BACK_OFF_S[1])
                continue
            if reply is None:
                self._stopped.wait(EMPTY_LOG_PAUSE_S)
                continue
            with self._changed:
                if ticket == self._tickets:
                    self._ready = reply
                    self._changed.notify_all()

    def _wait_for_demand(self) -> bool:
        with self._changed:
            self._changed.wait_for(lambda: self._ready is None or self._stopped.is_set())
        return not self._stopped.is_set()

    def _ask(self) -> Minibatches | None:
        """One call; none while the core has no minibatches to give."""
        asked_epoch = self._epoch()
        if self._proxy is None:
            # Connecting blindly to a core that has gone logs a traceback for every attempt.
            rospy.wait_for_service(SERVICE, timeout=BACK_OFF_S[1])
            self._proxy = rospy.ServiceProxy(SERVICE, GetMinibatches, persistent=True)
        response: GetMinibatchesResponse = self._proxy(self._particles, self._size)
        if not response.success:
            rospy.loginfo_throttle(WARNING_PERIOD_S, "waiting for beams: %s", response.message)
            return None
        shape = (len(self._particles), self._size, 3)
        return Minibatches(
            asked_epoch=asked_epoch,
            epoch=response.epoch,
            resampling=response.resampling,
            beams_in_log=response.beams_in_log,
            beams=unpack("beams", response.beams, shape),
        )

    def _disconnect(self) -> None:
        proxy, self._proxy = self._proxy, None
        if proxy is not None:
            proxy.close()
