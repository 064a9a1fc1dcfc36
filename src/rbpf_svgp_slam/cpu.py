"""What the numerical libraries read from the environment, once, when they are loaded."""

from __future__ import annotations

import os


def prepare(threads: int) -> None:
    """Set their number of threads; to be called before numpy or torch is imported.

    OpenMP's default, a thread for every core in each of several processes, makes them thrash.
    """
    os.environ["OMP_NUM_THREADS"] = str(threads)
