"""Robust weights of the log's beams, kept from one refolding of the maps to the next."""

from __future__ import annotations

from typing import Callable

import numpy as np


class BeamWeights:
    """By beam, how much of it counts; the same for all maps of a node.

    Finding out which beams lie off the seabed is most of the work of taking them in, and each
    correction of the histories takes in all of them again. So a beam's weight is found anew only
    1, 2, 4, 8, ... refoldings after its first: the past changes less and less, and the work per
    beam grows with the logarithm of their number. Four bytes a beam.
    """

    def __init__(self) -> None:
        self._weights = np.empty(0, np.float16)
        # Refolding by which a beam was first taken in, from 1 on; 0: it has not been.
        self._first_in = np.empty(0, np.uint16)
        self._refolding = 1

    def begin_refolding(self) -> None:
        """From now on the log's beams come from the first one again."""
        self._refolding = min(self._refolding + 1, np.iinfo(np.uint16).max)

    def of(self, first: int, count: int, find: Callable[[], np.ndarray]) -> np.ndarray:
        """Weights [count], 0 .. 1, of the log's beams from `first` on; find: them anew."""
        last = first + count
        self._make_room(last)
        first_in = self._first_in[first:last]
        if (first_in == 0).any() or _is_power_of_two(self._refolding - first_in).any():
            self._weights[first:last] = find()
            first_in[first_in == 0] = self._refolding
        return self._weights[first:last].astype(float)

    def _make_room(self, beams: int) -> None:
        lacking = beams - len(self._weights)
        if lacking > 0:
            more = max(lacking, len(self._weights) // 2)
            self._weights = np.pad(self._weights, (0, more))
            self._first_in = np.pad(self._first_in, (0, more))


def _is_power_of_two(numbers: np.ndarray) -> np.ndarray:
    return (numbers > 0) & (numbers & (numbers - 1) == 0)
