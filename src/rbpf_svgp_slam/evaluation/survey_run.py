"""What a finished run hands to the evaluation. Shapes: P pings, N beams, S inducing points."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Callable

import numpy as np

Predict = Callable[[np.ndarray], "tuple[np.ndarray, np.ndarray]"]


@dataclass
class GridMap:
    """A seabed on a grid of the map frame, metres, z up; NaN where nothing is known."""

    x: np.ndarray  # [nx] cell centres, increasing
    y: np.ndarray  # [ny]
    mean: np.ndarray  # [nx, ny]
    variance: np.ndarray | None = None  # [nx, ny] of the latent depth, m²; None: not known

    def __post_init__(self) -> None:
        expected = (len(self.x), len(self.y))
        _check_shape("mean", self.mean, expected)
        if self.variance is not None:
            _check_shape("variance", self.variance, expected)


@dataclass
class SurveyRun:
    """One run of the filter over one survey. Poses: [x y z roll pitch yaw], m and rad, map frame.

    The same beams appear three times, placed with three trajectories, in the same order.
    """

    stamp_s: np.ndarray  # [P] ping stamps
    estimate: np.ndarray  # [P, 6] weighted mean of the particles' histories
    dead_reckoning: np.ndarray  # [P, 6]
    beams: np.ndarray  # [N, 3] placed with the estimate
    beams_dead_reckoning: np.ndarray  # [N, 3]
    ping_of_beam: np.ndarray  # [N] index into the pings
    held_out: np.ndarray  # [P] bool, pings that no map was ever trained on
    map: GridMap
    predict: Predict  # xy [n, 2] to the latent mean [n] and variance [n], noise not included
    noise_variance_m2: float  # the map's learned σ²
    inducing_points: np.ndarray  # [S, 3]
    estimate_std_m: np.ndarray | None = None  # [P, 2] spread of the particles in x, y
    ground_truth: np.ndarray | None = None  # [P, 6], NaN rows where not covered
    beams_ground_truth: np.ndarray | None = None  # [N, 3]
    terrain: GridMap | None = None  # the true seabed, if it was simulated
    statistics: dict[str, Any] = field(default_factory=dict)  # counters, go into report.json
    status_history: dict[str, np.ndarray] = field(default_factory=dict)  # series over `t_s`
    config: dict[str, Any] = field(default_factory=dict)  # the full parameter set

    def __post_init__(self) -> None:
        pings, beams = len(self.stamp_s), len(self.beams)
        expected = {
            "stamp_s": (pings,),
            "estimate": (pings, 6),
            "estimate_std_m": (pings, 2),
            "dead_reckoning": (pings, 6),
            "ground_truth": (pings, 6),
            "beams": (beams, 3),
            "beams_dead_reckoning": (beams, 3),
            "beams_ground_truth": (beams, 3),
            "ping_of_beam": (beams,),
            "held_out": (pings,),
        }
        for name, shape in expected.items():
            if getattr(self, name) is not None:
                _check_shape(name, getattr(self, name), shape)
        if beams and not 0 <= self.ping_of_beam.min() <= self.ping_of_beam.max() < pings:
            raise ValueError(f"ping_of_beam: expected indices into {pings} pings")


def _check_shape(name: str, array: np.ndarray, expected: tuple[int, ...]) -> None:
    if np.shape(array) != expected:
        raise ValueError(f"{name}: expected shape {expected}, got {np.shape(array)}")
