"""The package's robust rule (docs/filter.md) in numpy, so that peers differ by their maps alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rbpf_svgp_slam.parameters.known import default_parameters

_BISECTIONS = 40  # of the tempering, in [0, 1]


@dataclass(frozen=True)
class Prediction:
    """Of n beams in the maps of J particles."""

    mean_m: np.ndarray  # [J, n]
    variance_m2: np.ndarray  # [J, n] of the map's depth, a beam's noise not included
    mapped: np.ndarray  # [J, n] bool: only where the seabed is mapped does a beam vote


@dataclass(frozen=True)
class WeightRule:
    """Names as in config/default.yaml, groups lc and resampling."""

    noise_std_m: float
    effective_beams: float
    student_t_dof: float
    min_overlap: float
    veto_sigma: float
    min_n_eff_share: float
    threshold: float

    @classmethod
    def shipped(cls) -> WeightRule:
        """What config/default.yaml has."""
        parameters = default_parameters()
        known = {**parameters["lc"], **parameters["resampling"]}
        return cls(**{name: known[name] for name in cls.__dataclass_fields__})

    def log_likelihood(self, z_m: np.ndarray, prediction: Prediction) -> np.ndarray | None:
        """Of a ping's depths [n], for each particle [J]; None where nothing is to be said."""
        mapped = prediction.mapped
        overlap = mapped.mean()
        if overlap < self.min_overlap:
            return None
        of_beam_m2 = np.where(mapped, prediction.variance_m2, 0.0).sum(axis=0)
        scale_m2 = of_beam_m2 / np.maximum(mapped.sum(axis=0), 1) + self.noise_std_m**2
        squares = np.where(mapped, (z_m - prediction.mean_m) ** 2 / scale_m2, 0.0)
        votes = mapped.sum(axis=1)
        heard = votes >= 0.5 * self.min_overlap * len(z_m)
        if np.sqrt((squares.sum(axis=1) / np.maximum(votes, 1))[heard].min()) > self.veto_sigma:
            return None
        nu = self.student_t_dof
        of_vote = -0.5 * (nu + 1) * np.log1p(squares / nu).sum(axis=1) / np.maximum(votes, 1)
        of_vote[~heard] = np.median(of_vote[heard])
        return self.effective_beams * overlap * of_vote

    def updated(self, weights: np.ndarray, log_likelihood: np.ndarray) -> np.ndarray:
        """The weights [J] afterwards: tempered so that no ping decides alone."""
        target = min(self.min_n_eff_share * len(weights), n_eff(weights))
        low, high = 0.0, 1.0
        if n_eff(_tempered(weights, log_likelihood, high)) >= target:
            return _tempered(weights, log_likelihood, high)
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            if n_eff(_tempered(weights, log_likelihood, middle)) < target:
                high = middle
            else:
                low = middle
        return _tempered(weights, log_likelihood, low)

    def asks_for_resampling(self, weights: np.ndarray) -> bool:
        """Whether too few particles count."""
        return n_eff(weights) < self.threshold * len(weights)


def n_eff(weights: np.ndarray) -> float:
    """How many of the particles count."""
    return 1.0 / float(np.sum(weights**2))


def systematic(weights: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Ancestors [J], drawn with one uniform number."""
    points = (np.arange(len(weights)) + rng.random()) / len(weights)
    ancestors = np.searchsorted(np.cumsum(weights), points, side="right")
    return np.minimum(ancestors, len(weights) - 1)  # the sum may be 1 less a rounding error


def _tempered(weights: np.ndarray, log_likelihood: np.ndarray, tau: float) -> np.ndarray:
    weighed = weights * np.exp(tau * (log_likelihood - log_likelihood.max()))
    return weighed / weighed.sum()
