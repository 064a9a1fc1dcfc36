"""The lock that keeps training steps and requests apart."""

from __future__ import annotations

import threading
from contextlib import contextmanager
from typing import Iterator


class StepLock:
    """A mutex that requests get before training steps do.

    Python's own locks are not fair: a loop that gives its lock back and takes it again at once
    keeps everybody else out for seconds. Here a step waits until no request does, so that a request
    waits for one step at most.
    """

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._held = False
        self._requests_waiting = 0

    @contextmanager
    def step(self) -> Iterator[None]:
        """Hold the lock for one training step."""
        with self._changed:
            self._take_for_step()
        try:
            yield
        finally:
            self._release()

    @contextmanager
    def request(self) -> Iterator[None]:
        """Hold the lock for a request, ahead of all training steps."""
        with self._changed:
            self._requests_waiting += 1
            try:
                self._changed.wait_for(lambda: not self._held)
            finally:
                self._requests_waiting -= 1
            self._held = True
        try:
            yield
        finally:
            self._release()

    def give_way(self) -> None:
        """In the midst of a step: lend the lock to the requests that wait for it."""
        with self._changed:
            if self._requests_waiting == 0:
                return
        self._release()
        with self._changed:
            self._take_for_step()

    def _take_for_step(self) -> None:
        """Wait until nobody holds the lock or waits with a request, with `_changed` held."""
        self._changed.wait_for(lambda: not self._held and self._requests_waiting == 0)
        self._held = True

    def _release(self) -> None:
        with self._changed:
            self._held = False
            self._changed.notify_all()
