"""The seabed of a finished survey: one map of all its beams, at the resolution that is wanted."""

from __future__ import annotations

from typing import Iterator

import numpy as np
from scipy.spatial import cKDTree

from rbpf_svgp_slam import _gmrf
from rbpf_svgp_slam.gmrf.study import FIRST_BEAMS, first_guess, sample_of

# Of a survey that would need more, the nodes lie further apart: some 20 s of one core.
MOST_NODES = 500_000
# The model is learned from so many places, square, so many nodes wide, each with so many beams.
PATCHES, PATCH_NODES, PATCH_BEAMS = 8, 16, 4000
# Beams that are weighted together, in the survey's order.
BLOCK_BEAMS = 4000
# Cells, and nodes likewise, as single numbers: i · 2³² + j.
KEY = np.array([2**32, 1])
# Of a depth's own standard deviation, beyond which a seabed is no longer what beams have told.
SIGMAS = 3.0


class SurveyMap:
    """All beams of a survey in one field, under a model that is learned from themselves."""

    def __init__(self, beams: np.ndarray, spacing_m: float, origin_m: np.ndarray) -> None:
        """beams: [n, 3] m in the survey's order, finite; spacing_m: wanted between the nodes;
        origin_m: [2] the place of one of them.

        Raises ValueError, which says what was expected, where the beams are too few.
        """
        if len(beams) < FIRST_BEAMS:
            raise ValueError(
                f"{len(beams)} beams to make it from; expected at least {FIRST_BEAMS}, "
                "to learn its model"
            )
        self._origin_m = np.asarray(origin_m, dtype=float)
        beams = np.asarray(beams, dtype=float) - [*self._origin_m, 0.0]
        #: Between the nodes: what was wanted, or a multiple of it.
        self.spacing_m = _affordable_spacing_m(beams, spacing_m)
        self._field = _gmrf.FieldModel(_learned(beams, self.spacing_m))
        self._core = _gmrf.Map(self.spacing_m, float(np.median(beams[:, 2])))
        for first in range(0, len(beams), BLOCK_BEAMS):
            block = beams[first : first + BLOCK_BEAMS]
            self._core.fold(block, self._core.robust_weights(self._field, block))
        nodes_m = self._core.nodes_with_data()
        self._nodes = cKDTree(nodes_m)
        self._lowest_m, self._highest_m = _heights_around(nodes_m, beams, self.spacing_m)

    @property
    def model(self) -> _gmrf.Model:
        """Spacing, lengthscale, outputscale and noise of the field."""
        return self._field.model

    @property
    def noise_variance_m2(self) -> float:
        """Of a beam about the seabed."""
        return self.model.noise_variance_m2

    def predict(self, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean [n] and variance [n] of the seabed at xy [n, 2], m and m², noise not included.

        NaN where no beam fell: where the nearest node has none in the four cells around it. And
        where the mean is out of reach of those that fell there, as beside a line of beams along a
        wall.
        """
        xy = np.asarray(xy, dtype=float) - self._origin_m
        # Half a cell along either axis is what lies nearest to a node, but for rounding.
        reach_m = 0.501 * self.spacing_m
        distance_m, node = self._nodes.query(xy, p=np.inf, distance_upper_bound=reach_m)
        known = np.isfinite(distance_m)
        mean, variance = np.full((2, len(xy)), np.nan)
        mean[known], variance[known] = self._core.predict(xy[known], self._field)
        known[known] = self._is_told(node[known], mean[known], variance[known])
        return np.where(known, mean, np.nan), np.where(known, variance, np.nan)

    def _is_told(self, node: np.ndarray, mean: np.ndarray, variance: np.ndarray) -> np.ndarray:
        """Whether means [n] near nodes [n] lie in reach of the beams in the cells around: as far
        beyond their heights as these are apart, or a slope of 45° leads across a cell."""
        lowest_m, highest_m = self._lowest_m[node], self._highest_m[node]
        reach_m = np.maximum(highest_m - lowest_m, self.spacing_m) + SIGMAS * np.sqrt(variance)
        return (mean > lowest_m - reach_m) & (mean < highest_m + reach_m)


def _affordable_spacing_m(beams: np.ndarray, spacing_m: float) -> float:
    """The wanted spacing, doubled until the nodes are not too many."""
    while True:
        if len(np.unique(_cells(beams, spacing_m))) <= MOST_NODES:
            return spacing_m
        spacing_m *= 2.0


def _cells(beams: np.ndarray, spacing_m: float) -> np.ndarray:
    """Of each beam [n] the cell, by its lower corner's key."""
    return np.floor(beams[:, :2] / spacing_m).astype(np.int64) @ KEY


def _heights_around(
    nodes_m: np.ndarray, beams: np.ndarray, spacing_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest z [K] of the beams in the four cells around each of the nodes [K, 2]."""
    cells = _cells(beams, spacing_m)
    order = np.argsort(cells, kind="stable")
    cells, z = cells[order], beams[order, 2]
    first = np.flatnonzero(np.diff(cells, prepend=cells[0] - 1))
    cells = cells[first]
    cell_lowest_m, cell_highest_m = np.minimum.reduceat(z, first), np.maximum.reduceat(z, first)
    nodes = np.rint(nodes_m / spacing_m).astype(np.int64) @ KEY
    lowest_m, highest_m = np.full(len(nodes), np.inf), np.full(len(nodes), -np.inf)
    for corner in np.ndindex(2, 2):
        wanted = nodes - np.dot(corner, KEY)
        at = np.minimum(np.searchsorted(cells, wanted), len(cells) - 1)
        hit = cells[at] == wanted
        lowest_m[hit] = np.minimum(lowest_m[hit], cell_lowest_m[at[hit]])
        highest_m[hit] = np.maximum(highest_m[hit], cell_highest_m[at[hit]])
    return lowest_m, highest_m


def _learned(beams: np.ndarray, spacing_m: float) -> _gmrf.Model:
    """Outliers are told by a model, and a model is learned without them: hence twice."""
    model = first_guess(beams, spacing_m)
    patches = list(_patches(beams, 0.5 * PATCH_NODES * spacing_m))
    for some in (patches[:1], patches):
        model = _gmrf.most_evident([sample_of(patch, model) for patch in some], model)
    return model


def _patches(beams: np.ndarray, reach_m: float) -> Iterator[np.ndarray]:
    """The beams [k, 3] of places spread over the survey, by all passes that have been there.

    A stretch of the survey has only its own pass, which agrees with itself better than several do:
    from stretches the noise would be learned too small.
    """
    for k in range(PATCHES):
        centre = beams[(2 * k + 1) * len(beams) // (2 * PATCHES), :2]
        near = np.flatnonzero((np.abs(beams[:, :2] - centre) < reach_m).all(axis=1))
        yield beams[near[:: -(-len(near) // PATCH_BEAMS)]]
