"""Independent GP tiles with margins, after Krasnosky and Roman (2022).

Each tile is an exact Gaussian process of the beams in it and in its margin, with its own model.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from bench.peers.exact_gp import GpModel, predict_for_particles
from bench.peers.histories import Histories
from bench.peers.patch_gp import BEAMS_PER_PING, LEAST_BEAMS
from bench.peers.weight_rule import Prediction
from rbpf_svgp_slam.parameters.known import default_parameters

TILE_M, MARGIN_M = 10.0, 3.0
#: The first beam in such a cell of a tile stays: some 250 of a tile and its margin.
CELL_M = 1.0
#: A tile's model is learned anew whenever it has so many times as many beams.
GROWTH = 1.5


@dataclass
class Tile:
    """Which beams it is made of; where they lie the particles' histories say."""

    beams: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=int))
    cells: np.ndarray = field(default_factory=lambda: np.empty((0, 2)))
    model: GpModel = GpModel()
    learned_from: int = 0


class TiledGp:
    """The tiles of J particles: they lie, and are thinned, as the mean of the histories says."""

    def __init__(self, histories: Histories) -> None:
        self._histories = histories
        self._mapped_variance = default_parameters()["lc"]["mapped_variance"]
        self._tiles: dict[tuple[int, int], Tile] = {}

    def learn(self, pings: np.ndarray) -> None:
        """Take the pings' beams into all tiles that they lie in, with margins."""
        beams = np.concatenate([self._histories.beams_of(ping, BEAMS_PER_PING) for ping in pings])
        xy_m = self._histories.placed_by_mean(beams)
        reached = [np.floor((xy_m + side) / TILE_M) for side in _SIDES_M]
        for i, j in np.unique(np.concatenate(reached), axis=0).astype(int):
            off_m = xy_m - TILE_M * np.array([i, j])
            inside = ((off_m >= -MARGIN_M) & (off_m < TILE_M + MARGIN_M)).all(axis=1)
            tile = self._tiles.setdefault((i, j), Tile())
            cells = np.concatenate([tile.cells, np.floor(off_m[inside] / CELL_M)])
            _, first = np.unique(cells, axis=0, return_index=True)
            first.sort()  # in the order in which they came
            tile.cells = cells[first]
            tile.beams = np.concatenate([tile.beams, beams[inside]])[first]

    def predict(self, beams: np.ndarray) -> Prediction:
        """Each beam by the tile that it lies in, in each particle."""
        xy_m = self._histories.placed(beams)
        mean_m, variance_m2 = np.zeros(xy_m.shape[:2]), np.zeros(xy_m.shape[:2])
        mapped = np.zeros(xy_m.shape[:2], dtype=bool)
        corners = np.floor(xy_m / TILE_M).astype(int)
        for corner in np.unique(corners.reshape(-1, 2), axis=0):
            tile = self._tiles.get(tuple(corner))
            if tile is None or len(tile.beams) < LEAST_BEAMS:
                continue
            self._keep_learned(tile)
            here = (corners == corner).all(axis=-1)
            z_m = self._histories.levelled[tile.beams, 2]
            own_m = self._histories.placed(tile.beams)
            mean, variance = predict_for_particles(tile.model, own_m, z_m, xy_m, here)
            mean_m[here], variance_m2[here] = mean[here], variance[here]
            mapped |= here & (variance < self._mapped_variance * tile.model.outputscale_m2)
        return Prediction(mean_m, variance_m2, mapped)

    def resample(self, ancestors: np.ndarray) -> None:
        """Nothing: the histories say where the tiles' beams lie."""

    def _keep_learned(self, tile: Tile) -> None:
        if len(tile.beams) < GROWTH * tile.learned_from:
            return
        tile.learned_from = len(tile.beams)
        xy_m = self._histories.placed_by_mean(tile.beams)
        tile.model = tile.model.learned(xy_m, self._histories.levelled[tile.beams, 2])


_SIDES_M = MARGIN_M * np.array([[i, j] for i in (-1, 0, 1) for j in (-1, 0, 1)])
