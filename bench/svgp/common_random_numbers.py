"""What the same beams for all maps do to the differences between particles' log-weights.

With mapping/common_random_numbers the k-th minibatches of all particles hold the same beams of the
log. Two particles: one at the truth, the other with the same history, or with one that is displaced
by a constant; a displaced particle is right about everything but where the map's frame is, so that
the two log-weights should be equal.
"""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any, Callable

import numpy as np

from bench.svgp import in_process
from bench.svgp.surveys import (
    ALTITUDE_M,
    AREA_M,
    HALF_SWATH_RAD,
    LINE_SPACING_M,
    NOISE_STD_M,
    run_survey,
    smooth_relief,
)
from rbpf_svgp_slam.maps import MinibatchMap, SeabedMap
from rbpf_svgp_slam.survey_area.polygon import survey_origin
from rbpf_svgp_slam.svgp.group import SvgpGroup

S, M, STEPS, BEAMS = 225, 500, 300, 100_000
#: So many beams are in the sample that a streaming map is rebuilt from.
SAMPLE = 40_000
#: How far the second particle is displaced, along x, m.
OFFSET_M = 1.0
#: So many pairs of maps are compared, each with random numbers of its own.
REPETITIONS = 8
PINGS, BEAMS_OF_PING = 20, 256
#: The standard deviation added to predictions in the weights, m, and two settings of the robust
#: rule.
LC_NOISE_STD_M, EFFECTIVE_BEAMS, STUDENT_T_DOF = 0.3, 30.0, 4.0
SURVEY_SEED = 1

#: Mean and variance [PINGS, BEAMS_OF_PING] of a map at the pings' beams.
Predictions = tuple[np.ndarray, np.ndarray]


class Study:
    """The survey of all repetitions: what varies is which beams a map is trained on."""

    def __init__(self, S: int = S, M: int = M, steps: int = STEPS, beams: int = BEAMS) -> None:
        self._settings = {"inducing_points": S, "minibatch_size": M}
        self._M, self._steps = M, steps
        relief = smooth_relief(SURVEY_SEED)
        survey = run_survey(relief, beams, SURVEY_SEED)
        self._area = survey.area_m
        self._origin = np.append(survey_origin(self._area), 0.0)
        self._beams = (survey.training.xyz_m - self._origin).astype(np.float32)
        rng = np.random.default_rng(SURVEY_SEED)
        xy = _pings(rng)
        self.z = relief.height_m(xy[..., 0], xy[..., 1])
        self.z += NOISE_STD_M * rng.standard_normal(self.z.shape)
        self._xy = (xy - self._origin[:2]).astype(np.float32)

    def trained(self, optimizer: str, offset_m: float, seed: int) -> SeabedMap:
        """The map of a particle with such an offset, by minibatches of such a seed."""
        engine = self._group(optimizer).create()
        self._train(engine, offset_m, seed)
        return engine

    def taught(self, seed: int) -> SvgpGroup:
        """A node of streaming maps, whose teacher has learned from the first particle's beams."""
        node = self._group("streaming")
        self._train(node.teacher, 0.0, seed)
        return node

    def streamed(self, node: SvgpGroup, offset_m: float, seed: int | None) -> SeabedMap:
        """A streaming map; seed: of a sample that stands for the log; none: of the whole log."""
        engine, beams = node.create(), self._displaced(offset_m)
        sample = beams
        if seed is not None:
            sample = beams[np.random.default_rng([seed, 2]).integers(0, len(beams), SAMPLE)]
        engine.rebuild(sample, len(beams))
        return engine

    def predict(self, engine: SeabedMap, offset_m: float) -> Predictions:
        """At the pings as a particle with such an offset places them."""
        xy = self._xy.reshape(-1, 2) + np.array([offset_m, 0.0], dtype=np.float32)
        mean, variance = engine.predict(xy)
        return mean.reshape(self.z.shape), variance.reshape(self.z.shape)

    def _train(self, engine: MinibatchMap, offset_m: float, seed: int) -> None:
        rng = np.random.default_rng([seed, 1])
        in_process.train((engine,), self._displaced(offset_m), self._M, self._steps, rng)

    def _group(self, optimizer: str) -> SvgpGroup:
        return in_process.group(self._area, optimizer=optimizer, **self._settings)

    def _displaced(self, offset_m: float) -> np.ndarray:
        return self._beams + np.array([offset_m, 0.0, 0.0], dtype=np.float32)


def _pings(rng: np.random.Generator) -> np.ndarray:
    """Beam positions [PINGS, BEAMS_OF_PING, 2] across tracks within the area, m."""
    margin_m = 2.0 * LINE_SPACING_M
    low, high = np.array([margin_m, margin_m]), np.array(AREA_M) - margin_m
    centres = rng.uniform(low, high, (PINGS, 2))
    angles = np.linspace(-HALF_SWATH_RAD, HALF_SWATH_RAD, BEAMS_OF_PING)
    xy = np.repeat(centres[:, None], BEAMS_OF_PING, axis=1)
    xy[..., 1] += ALTITUDE_M * np.tan(angles)
    return xy


def product_difference(z: np.ndarray, one: Predictions, other: Predictions) -> np.ndarray:
    """log w of one particle less the other's, by the paper's rule, for pings z [n, beams]: [n]."""

    def log_likelihood(mean: np.ndarray, variance: np.ndarray) -> np.ndarray:
        total = variance + LC_NOISE_STD_M**2
        return -0.5 * ((z - mean) ** 2 / total + np.log(2.0 * np.pi * total)).sum(1)

    return log_likelihood(*one) - log_likelihood(*other)


def robust_difference(z: np.ndarray, one: Predictions, other: Predictions) -> np.ndarray:
    """The same by the filter's robust rule, where all beams lie over mapped seabed."""
    # −n·(ν + 1)/2·mean log(1 + e²/(ν s²)), with one s² for both particles
    scale2 = 0.5 * (one[1] + other[1]) + LC_NOISE_STD_M**2

    def log_likelihood(mean: np.ndarray) -> np.ndarray:
        logs = np.log1p((z - mean) ** 2 / (STUDENT_T_DOF * scale2)).mean(1)
        return -0.5 * EFFECTIVE_BEAMS * (STUDENT_T_DOF + 1.0) * logs

    return log_likelihood(one[0]) - log_likelihood(other[0])


RULES: dict[str, Callable[..., np.ndarray]] = {
    "product": product_difference,
    "robust": robust_difference,
}


#: Predictions of the one and the other particle's map, for each repetition.
Pairs = list[tuple[Predictions, Predictions]]


def run(out: Path) -> dict[str, Any]:
    """Standard deviation and mean of differences, by optimizer, offset and kind of numbers."""
    study = Study()
    results = {name: compare(study.z, by_minibatches(study, name)) for name in ("adam", "natgrad")}
    results["streaming"] = compare(study.z, by_streaming(study))
    rows = [
        {"optimizer": optimizer, "particles": name} | figures
        for optimizer, group in results.items()
        for name, figures in group.items()
    ]
    print(in_process.markdown(rows), flush=True)
    return {"common_random_numbers": results}


def compare(z: np.ndarray, pairs: dict[str, Pairs]) -> dict[str, dict[str, float]]:
    """Of the difference of log-weights, by rule: its standard deviation over repetitions, as the
    root mean square of all pings', and its mean."""
    figures: dict[str, dict[str, float]] = {}
    for name, repetitions in pairs.items():
        figures[name] = {}
        for rule, difference in RULES.items():
            values = np.array([difference(z, *pair) for pair in repetitions])
            figures[name][f"{rule}, std"] = float(np.sqrt(values.var(0, ddof=1).mean()))
            figures[name][f"{rule}, mean"] = float(values.mean())
    return figures


def by_minibatches(
    study: Study, optimizer: str, repetitions: int = REPETITIONS
) -> dict[str, Pairs]:
    """Maps of the same beams have the same seed; all pairs of other seeds are independent."""
    seeds = range(repetitions)
    engines = [study.trained(optimizer, 0.0, seed) for seed in seeds]
    same = [study.predict(engine, 0.0) for engine in engines]
    displaced = [
        study.predict(study.trained(optimizer, OFFSET_M, seed), OFFSET_M) for seed in seeds
    ]
    again = [study.predict(study.trained(optimizer, 0.0, seed), 0.0) for seed in seeds[:2]]
    others = list(itertools.permutations(seeds, 2))
    return {
        "same history, common beams": list(zip(same, again)),
        "same history, independent beams": [(same[i], same[j]) for i, j in others],
        f"{OFFSET_M:g} m apart, common beams": list(zip(same, displaced)),
        f"{OFFSET_M:g} m apart, independent beams": [(same[i], displaced[j]) for i, j in others],
        f"same map, a pose {OFFSET_M:g} m off": [
            (one, study.predict(engine, OFFSET_M)) for one, engine in zip(same, engines)
        ],
    }


def by_streaming(study: Study, repetitions: int = REPETITIONS) -> dict[str, Pairs]:
    """Whole logs leave nothing to chance; samples of them, as for a rebuild, do."""
    pairs: dict[str, Pairs] = {}
    for seed in range(repetitions):
        node = study.taught(seed)
        kinds = {
            "whole log": (None, None),
            "common sample": (seed, seed),
            "independent samples": (seed, seed + repetitions),
        }
        for (kind, (one, other)), offset_m in itertools.product(kinds.items(), (0.0, OFFSET_M)):
            pair = tuple(
                study.predict(study.streamed(node, *which), which[0])
                for which in ((0.0, one), (offset_m, other))
            )
            history = f"{offset_m:g} m apart" if offset_m else "same history"
            pairs.setdefault(f"{history}, {kind}", []).append(pair)
    return pairs
