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
        self._nodes = cKDTree(self._core.nodes_with_data())

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

        NaN where no beam fell: where the nearest node has none in the four cells around it.
        """
        xy = np.asarray(xy, dtype=float) - self._origin_m
        # Half a cell along either axis is what lies nearest to a node, but for rounding.
        reach_m = 0.501 * self.spacing_m
        distance_m, _ = self._nodes.query(xy, p=np.inf, distance_upper_bound=reach_m)
        known = np.isfinite(distance_m)
        mean, variance = np.full((2, len(xy)), np.nan)
        mean[known], variance[known] = self._core.predict(xy[known], self._field)
        return mean, variance


def _affordable_spacing_m(beams: np.ndarray, spacing_m: float) -> float:
    """The wanted spacing, doubled until the nodes are not too many."""
    while True:
        cells = np.floor(beams[:, :2] / spacing_m).astype(np.int64)
        if len(np.unique(cells @ [2**32, 1])) <= MOST_NODES:
            return spacing_m
        spacing_m *= 2.0


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
