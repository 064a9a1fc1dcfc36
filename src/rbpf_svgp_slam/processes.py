"""Child processes: they must not outlive the one that started them, and may be started again."""

from __future__ import annotations

import ctypes
import signal
import time

#: A process that a signal ends so often within so long will not live.
MOST_DEATHS, DEATHS_WITHIN_S = 5, 60.0
_PR_SET_PDEATHSIG = 1  # of prctl(2)


class Deaths:
    """Of one process and those that have taken its place."""

    def __init__(self, name: str) -> None:
        """name: of the process, for what is told."""
        self._name = name
        self._at_s: list[float] = []

    def __len__(self) -> int:
        return len(self._at_s)

    def add(self, status: int) -> str:
        """One more, by the signal -status: what is to be told of it."""
        self._at_s.append(time.monotonic())
        what = f"{self._name} was killed by {signal.Signals(-status).name}"
        if self.too_many:
            return f"{what}, {MOST_DEATHS} times within {DEATHS_WITHIN_S:.0f} s: it is given up"
        return f"{what}: it is started again"

    @property
    def too_many(self) -> bool:
        """To be started once more."""
        latest = self._at_s[-MOST_DEATHS:]
        return len(latest) == MOST_DEATHS and latest[-1] - latest[0] < DEATHS_WITHIN_S


def end_with_parent() -> None:
    """In a child, before its program: it ends when its parent does, even if that is killed."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
