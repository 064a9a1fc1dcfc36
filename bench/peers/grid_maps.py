"""A grid in each particle: the featureless filter of Barkby et al. (2009, 2012)."""

from __future__ import annotations

import numpy as np

from bench.peers.histories import Histories
from bench.peers.weight_rule import Prediction

CELL_M = 1.0
#: A cell with fewer beams is not mapped.
LEAST_BEAMS = 3
#: Of a beam about its cell's depth, for what the grid says of its own error: noise and slope.
BEAM_STD_M = 0.3
#: Particles may leave what dead reckoning reaches by so much; beyond there is no map.
MARGIN_M = 50.0


class GridMaps:
    """Running means and counts of beams in cells, [J, nx, ny]."""

    def __init__(self, histories: Histories, low_m: np.ndarray, high_m: np.ndarray) -> None:
        """low_m, high_m [2]: corners of what dead reckoning's beams reach, m."""
        self._histories = histories
        self._low_m = np.floor(low_m - MARGIN_M)
        cells = np.ceil((high_m + MARGIN_M - self._low_m) / CELL_M).astype(int)
        self.mean_m = np.zeros((histories.particles, *cells), dtype=np.float32)
        self.count = np.zeros_like(self.mean_m)

    def learn(self, pings: np.ndarray) -> None:
        """Take in all beams of the pings."""
        every = len(self._histories.levelled)
        beams = np.concatenate([self._histories.beams_of(ping, every) for ping in pings])
        cells, inside = self._cells(beams)
        corner = cells.min(axis=(0, 1))
        box = (len(cells), *(cells.max(axis=(0, 1)) + 1 - corner))
        particle = np.broadcast_to(np.arange(len(cells))[:, None], inside.shape)
        key = np.ravel_multi_index((particle, *np.moveaxis(cells - corner, -1, 0)), box)[inside]
        z_m = np.broadcast_to(self._histories.levelled[beams, 2], inside.shape)[inside]
        count = np.bincount(key, minlength=np.prod(box)).reshape(box)
        total_m = np.bincount(key, z_m, minlength=np.prod(box)).reshape(box)
        here = (slice(None), *(slice(first, first + n) for first, n in zip(corner, box[1:])))
        self.count[here] += count
        self.mean_m[here] += (total_m - count * self.mean_m[here]) / np.maximum(self.count[here], 1)

    def predict(self, beams: np.ndarray) -> Prediction:
        """Of each beam the mean of the cell that it falls into."""
        cells, inside = self._cells(beams)
        at = (np.arange(len(cells))[:, None], cells[..., 0], cells[..., 1])
        count = self.count[at]
        mapped = inside & (count >= LEAST_BEAMS)
        return Prediction(self.mean_m[at], BEAM_STD_M**2 / np.maximum(count, 1), mapped)

    def resample(self, ancestors: np.ndarray) -> None:
        """Copy whole grids."""
        self.mean_m, self.count = self.mean_m[ancestors], self.count[ancestors]

    def _cells(self, beams: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The cells [J, n, 2] of the beams, and whether they are there [J, n]."""
        cells = np.floor((self._histories.placed(beams) - self._low_m) / CELL_M).astype(int)
        last = np.array(self.count.shape[1:]) - 1
        return np.clip(cells, 0, last), ((cells >= 0) & (cells <= last)).all(axis=-1)
