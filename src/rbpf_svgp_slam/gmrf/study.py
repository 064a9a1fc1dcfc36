"""The field's model from the log's beams: at the start, and slowly afterwards."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from rbpf_svgp_slam import _gmrf
from rbpf_svgp_slam.gmrf.gmrf_config import GmrfConfig

# Beams in the log at the first study, and what that grows by until the next.
FIRST_BEAMS, GROWTH = 4000, 4
# Of the log's latest beams that are studied then, and studies that are remembered.
SAMPLE_BEAMS, SAMPLES = 4000, 8
# The nodes are at least so many mean distances between beams apart.
BEAMS_PER_NODE = 2.0
# What the grid cannot represent may be so many standard deviations of a beam's noise.
LARGEST_DISCRETISATION = 1.25
# That of a beam three standard deviations off: those of less are left out of a sample.
OUTLIER_WEIGHT = 5.0 / 13.0
# Spacings to choose from are this step apart, from 1 m up and down.
SPACING_STEP = math.sqrt(2.0)
# A search starts from this lengthscale, or from so many nodes where these are wide; and from the
# beams' own variance, of which the noise has this share.
START_LENGTHSCALE_M, START_NODES, START_NOISE_SHARE = 25.0, 4.0, 0.01


class Study:
    """Learns a model of the field from stretches of the log, by its evidence.

    The evidence is that of a grid as fine as the beams: on the maps' own, wider one, what the grid
    cannot represent would pass for the beams' noise, or the other way round.
    """

    def __init__(self, config: GmrfConfig) -> None:
        self._config = config
        self._samples: list[_gmrf.Sample] = []
        self._next = FIRST_BEAMS
        self._fine: _gmrf.Model | None = None
        #: Of the maps; none before the first study.
        self.field: _gmrf.FieldModel | None = None
        #: Of the last sample, log p per beam, nats.
        self.evidence = math.nan

    def due(self, beams_in_log: int) -> tuple[int, int] | None:
        """First beam and number of those to be studied; none while the log is too short."""
        if beams_in_log < self._next:
            return None
        size = min(SAMPLE_BEAMS, self._next)
        return self._next - size, size

    def learn(self, beams: np.ndarray) -> None:
        """From the beams [n, 3] that were due: neighbours of each other, as the log has them."""
        beams = np.asarray(beams, dtype=float)
        fine = self._fine or self._first_model(beams)
        self._samples = [*self._samples[1 - SAMPLES :], sample_of(beams, fine)]
        self._fine = self._most_evident(fine)
        spacing_m = self.field.model.spacing_m if self.field else self._spacing_m()
        self.field = _gmrf.FieldModel(_with(self._fine, spacing_m=spacing_m))
        self.evidence = _gmrf.log_evidence(self._samples[-1], self._fine) / len(beams)
        self._next *= GROWTH

    def _first_model(self, beams: np.ndarray) -> _gmrf.Model:
        """A model by which outliers can be told."""
        fine = self._configured(first_guess(beams, BEAMS_PER_NODE * mean_distance_m(beams)))
        self._samples = [sample_of(beams, fine)]
        fine = self._most_evident(fine)
        self._samples = []
        return fine

    def _spacing_m(self) -> float:
        """Of the maps, from now on."""
        return self._config.spacing_m or coarsest_spacing_m(self._fine)

    def _most_evident(self, start: _gmrf.Model) -> _gmrf.Model:
        return self._configured(_gmrf.most_evident(self._samples, start))

    def _configured(self, model: _gmrf.Model) -> _gmrf.Model:
        """With the configuration's values where it has some."""
        config = self._config
        return _with(
            model,
            lengthscale_m=config.lengthscale_m or model.lengthscale_m,
            outputscale_m2=config.outputscale_m2 or model.outputscale_m2,
            noise_variance_m2=config.noise_std_m**2 or model.noise_variance_m2,
        )


def first_guess(beams: np.ndarray, spacing_m: float) -> _gmrf.Model:
    """Where a search for the model of beams [n, 3] starts from."""
    variance_m2 = max(float(np.var(beams[:, 2])), 1e-6)
    return _gmrf.Model(
        spacing_m,
        lengthscale_m=max(START_LENGTHSCALE_M, START_NODES * spacing_m),
        outputscale_m2=variance_m2,
        noise_variance_m2=START_NOISE_SHARE * variance_m2,
    )


def sample_of(beams: np.ndarray, model: _gmrf.Model) -> _gmrf.Sample:
    """Those of beams [n, 3] that are no outliers under a model.

    At full weight: robust weights would make the noise too small.
    """
    alone = _gmrf.Map(model.spacing_m, float(np.median(beams[:, 2])))
    weights = alone.robust_weights(_gmrf.FieldModel(model), beams)
    good = weights > OUTLIER_WEIGHT
    return _gmrf.Sample(beams[good], np.ones(np.count_nonzero(good)))


def mean_distance_m(beams: np.ndarray) -> float:
    """Of beams [n, 3] from each other, if they lay on a square grid over the same area."""
    try:
        area_m2 = ConvexHull(beams[:, :2]).volume
    except QhullError:  # all on one line
        area_m2 = 0.0
    length_m = float(np.linalg.norm(np.ptp(beams[:, :2], axis=0)))
    return max(math.sqrt(area_m2 / len(beams)), length_m / len(beams), 1e-3)


def coarsest_spacing_m(model: _gmrf.Model) -> float:
    """The widest spacing at which what the grid cannot represent stays below the beams' noise.

    No narrower than the model's own.
    """
    limit_m2 = LARGEST_DISCRETISATION**2 * model.noise_variance_m2
    step = math.ceil(math.log(model.spacing_m, SPACING_STEP) - 1e-9)
    # No wider than a quarter of l, where the grid is no image of the field any more.
    while SPACING_STEP ** (step + 1) < 0.25 * model.lengthscale_m:
        wider = _with(model, spacing_m=SPACING_STEP ** (step + 1))
        if _gmrf.FieldModel(wider).discretisation_variance_m2 > limit_m2:
            break
        step += 1
    return SPACING_STEP**step


def _with(model: _gmrf.Model, **changes: float) -> _gmrf.Model:
    names = ("spacing_m", "lengthscale_m", "outputscale_m2", "noise_variance_m2")
    return _gmrf.Model(**{name: changes.get(name, getattr(model, name)) for name in names})
