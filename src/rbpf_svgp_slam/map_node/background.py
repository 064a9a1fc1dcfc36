"""Calls that take their time, while something else is done."""

from __future__ import annotations

import queue
import threading
from concurrent.futures import Future
from typing import Any, Callable


class Background:
    """One call after the other, on a thread of its own.

    Like an executor of concurrent.futures, which however waits for the call under way before the
    program ends: a host that has gone may never answer it.
    """

    def __init__(self, name: str) -> None:
        self._calls: queue.SimpleQueue[tuple[Future, Callable, tuple] | None] = queue.SimpleQueue()
        threading.Thread(target=self._run, name=name, daemon=True).start()

    def submit(self, call: Callable, *arguments: Any) -> Future:
        """The call's result, in time."""
        future: Future = Future()
        self._calls.put((future, call, arguments))
        return future

    def stop(self) -> None:
        """End the thread when it has made the calls that it has been given."""
        self._calls.put(None)

    def _run(self) -> None:
        while call := self._calls.get():
            carry_out(*call)


class AtOnce:
    """In place of a Background: the result is there when `submit` returns."""

    def submit(self, call: Callable, *arguments: Any) -> Future:
        """The call's result."""
        future: Future = Future()
        carry_out(future, call, arguments)
        return future

    def stop(self) -> None:
        """There is nothing to end."""


def carry_out(future: Future, call: Callable, arguments: tuple) -> None:
    """A call's result or exception into its future."""
    try:
        future.set_result(call(*arguments))
    except Exception as error:  # whatever it is: whoever waits must be told
        future.set_exception(error)
