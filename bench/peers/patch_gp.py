"""A GP of the patch under the ping, trained anew for each: trajectory maps, Barkby et al. (2011).

A particle keeps no map, only its trajectory: what lies under a ping is a Gaussian process of the
older beams near it, placed as the particle's own trajectory says.
"""

from __future__ import annotations

import numpy as np

from bench.peers.exact_gp import GpModel, predict_for_particles
from bench.peers.histories import Histories
from bench.peers.weight_rule import Prediction
from rbpf_svgp_slam.parameters.known import default_parameters

#: The patch reaches beyond the ping's beams by so much, on all sides.
REACH_M = 6.0
#: One beam of each such cell is taken: some 250 of a fan 50 m wide.
CELL_M = 1.6
#: Fewer make no map.
LEAST_BEAMS = 30
#: Of a ping, what is kept for maps.
BEAMS_PER_PING = 64


class PatchGp:
    """The trajectory maps of J particles."""

    def __init__(self, histories: Histories, rng: np.random.Generator) -> None:
        self._histories, self._rng = histories, rng
        self._mapped_variance = default_parameters()["lc"]["mapped_variance"]
        self._old = np.empty(0, dtype=int)  # beams
        self._model = GpModel()

    def learn(self, pings: np.ndarray) -> None:
        """Remember the pings' beams."""
        beams = [self._histories.beams_of(ping, BEAMS_PER_PING) for ping in pings]
        self._old = np.concatenate([self._old, *beams])

    def predict(self, beams: np.ndarray) -> Prediction:
        """By the patch about the beams."""
        xy_m = self._histories.placed(beams)
        patch = self._patch(beams)
        if len(patch) < LEAST_BEAMS:
            nothing = np.zeros(xy_m.shape[:2])
            return Prediction(nothing, nothing, nothing.astype(bool))
        z_m = self._histories.levelled[patch, 2]
        self._model = self._model.learned(self._histories.placed_by_mean(patch), z_m)
        mean_m, variance_m2 = predict_for_particles(
            self._model,
            self._histories.placed(patch),
            z_m,
            xy_m,
            np.ones(xy_m.shape[:2], dtype=bool),
        )
        mapped = variance_m2 < self._mapped_variance * self._model.outputscale_m2
        return Prediction(mean_m, variance_m2, mapped)

    def resample(self, ancestors: np.ndarray) -> None:
        """Nothing: the histories are the maps."""

    def _patch(self, beams: np.ndarray) -> np.ndarray:
        """Old beams near these, of one ping, thinned: at random one of each cell."""
        histories = self._histories
        ping = histories.ping_of_beam[beams[:1]]
        x, y, yaw = histories.mean(ping)[0]
        off_m = histories.placed_by_mean(self._old) - (x, y)
        forward_m = np.cos(yaw) * off_m[:, 0] + np.sin(yaw) * off_m[:, 1]
        left_m = np.cos(yaw) * off_m[:, 1] - np.sin(yaw) * off_m[:, 0]
        fan_m = histories.levelled[beams]
        near = np.abs(forward_m - fan_m[:, 0].mean()) < REACH_M
        near &= (left_m > fan_m[:, 1].min() - REACH_M) & (left_m < fan_m[:, 1].max() + REACH_M)
        drawn = self._rng.permutation(np.flatnonzero(near))
        cells = np.floor(np.column_stack([forward_m, left_m])[drawn] / CELL_M)
        _, first = np.unique(cells, axis=0, return_index=True)
        return self._old[drawn[first]]
