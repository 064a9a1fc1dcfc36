"""Another program's load: one core, kept busy for a share of the time."""

from __future__ import annotations

import contextlib
import multiprocessing
import time
from typing import Iterator

PERIOD_S = 1.0


@contextlib.contextmanager
def busy_core(share: float) -> Iterator[None]:
    """Beside what is done within: busy for `share` (0 .. 1) of each second, asleep for the rest."""
    if share <= 0.0:
        yield
        return
    # Not forked: this process has threads.
    process = multiprocessing.get_context("spawn").Process(target=_burn, args=(share,), daemon=True)
    process.start()
    try:
        yield
    finally:
        process.terminate()
        process.join()


def _burn(share: float) -> None:
    while True:
        end_s = time.monotonic() + share * PERIOD_S
        while time.monotonic() < end_s:
            pass
        time.sleep((1.0 - share) * PERIOD_S)
