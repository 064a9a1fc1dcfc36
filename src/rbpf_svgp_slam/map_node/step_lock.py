"""The lock that training steps and requests take turns with."""

from __future__ import annotations

import threading
from contextlib import contextmanager
from typing import Iterator


class StepLock:
    """A mutex that requests get before training does.

    Python's own locks are not fair: a loop that gives its lock back and takes it again at once
    keeps everybody else out for seconds. Here a step lets all waiting requests go first, so that
    a request waits for one step at most.
    """

    def __init__(self) -> None:
        self._turn = threading.Condition()
        self._held = False
        self._requests_waiting = 0

    @contextmanager
    def step(self) -> Iterator[None]:
        """Hold the lock for one training step."""
        with self._turn:
            self._take_turn()
        try:
            yield
        finally:
            self._release()

    @contextmanager
    def request(self) -> Iterator[None]:
        """Hold the lock for a request, ahead of all training steps."""
        with self._turn:
            self._requests_waiting += 1
            try:
                self._turn.wait_for(lambda: not self._held)
            finally:
                self._requests_waiting -= 1
            self._held = True
        try:
            yield
        finally:
            self._release()

    def give_way(self) -> None:
        """In the midst of a step: let the requests that wait go first."""
        with self._turn:
            if self._requests_waiting == 0:
                return
        self._release()
        with self._turn:
            self._take_turn()

    def _take_turn(self) -> None:
        """With `_turn` held."""
        self._turn.wait_for(lambda: not self._held and self._requests_waiting == 0)
        self._held = True

    def _release(self) -> None:
        with self._turn:
            self._held = False
            self._turn.notify_all()
