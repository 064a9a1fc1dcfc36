"""What a finished run hands to the evaluation. Shapes: P pings, N beams, S support points."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Callable

import numpy as np

from rbpf_svgp_slam.gmrf.survey_map import SurveyMap
from rbpf_svgp_slam.run.closures import Closures
from rbpf_svgp_slam.run.fixes import Fixes
from rbpf_svgp_slam.survey_area.grid import grid_points

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

    @property
    def resolution_m(self) -> float:
        """Between the cells along x; of two of them at least."""
        return float(np.ptp(self.x)) / (len(self.x) - 1)


@dataclass
class StoredMap:
    """A particle's whole map as its engine wrote it, to be asked anywhere, at any time."""

    engine: str  # map/engine
    state: bytes
    origin_m: np.ndarray  # [2] survey origin, frame map: what the engine's positions count from


@dataclass
class TimeLapse:
    """One particle's map at K instants of the survey, on a coarse grid."""

    t_s: np.ndarray  # [K] stamps
    x: np.ndarray  # [nx]
    y: np.ndarray  # [ny]
    mean: np.ndarray  # [K, nx, ny] m

    def __post_init__(self) -> None:
        expected = (len(self.t_s), len(self.x), len(self.y))
        _check_shape("time lapse's mean", self.mean, expected)


@dataclass
class SurveyRun:
    """One run of the filter over one survey. Poses: [x y z roll pitch yaw], m, rad, map frame."""

    stamp_s: np.ndarray  # [P] ping stamps
    estimate: np.ndarray  # [P, 6] as all of the survey has it: the final one
    dead_reckoning: np.ndarray  # [P, 6]
    levelled: np.ndarray  # [N, 3] beams: x, y in the levelled body frame, z in map, m
    ping_of_beam: np.ndarray  # [N] index into the pings
    held_out: np.ndarray  # [P] bool, pings that no map was ever trained on
    map: GridMap
    predict: Predict  # xy [n, 2] to the latent mean [n] and variance [n], noise not included
    noise_variance_m2: float  # the map's learned σ²
    support_points: np.ndarray  # [S, 3] x, y, predicted z: where the map spends its memory
    stored_map: StoredMap | None = None  # what `predict` asks
    # Covariances: xx, xy, x yaw, yy, y yaw, yaw yaw.
    estimate_covariance: np.ndarray | None = None  # [P, 6]
    online: np.ndarray | None = None  # [P, 6] the estimate when each ping was taken in
    online_covariance: np.ndarray | None = None  # [P, 6]
    closures: Closures | None = None  # loop closures, if the run has recorded them
    fixes: Fixes | None = None  # absolute positions, if the run has recorded them
    ground_truth: np.ndarray | None = None  # [P, 6], NaN rows where not covered
    terrain: GridMap | None = None  # the true seabed, if it was simulated
    statistics: dict[str, Any] = field(default_factory=dict)  # counters, go into report.json
    status_history: dict[str, np.ndarray] = field(default_factory=dict)  # series over `t_s`
    time_lapse: TimeLapse | None = None
    config: dict[str, Any] = field(default_factory=dict)  # the full parameter set
    support_label: str = "support points"  # what the map's engine calls them

    def __post_init__(self) -> None:
        pings, beams = len(self.stamp_s), len(self.levelled)
        expected = {
            "stamp_s": (pings,),
            "estimate": (pings, 6),
            "estimate_covariance": (pings, 6),
            "online": (pings, 6),
            "online_covariance": (pings, 6),
            "dead_reckoning": (pings, 6),
            "ground_truth": (pings, 6),
            "levelled": (beams, 3),
            "ping_of_beam": (beams,),
            "held_out": (pings,),
        }
        for name, shape in expected.items():
            if getattr(self, name) is not None:
                _check_shape(name, getattr(self, name), shape)
        if beams and not 0 <= self.ping_of_beam.min() <= self.ping_of_beam.max() < pings:
            raise ValueError(f"ping_of_beam: expected indices into {pings} pings")

    # The same beams, placed in map with three trajectories, [N, 3].

    @cached_property
    def beams(self) -> np.ndarray:
        """Placed with the estimate."""
        return self._placed(self.estimate)

    @cached_property
    def beams_dead_reckoning(self) -> np.ndarray:
        """Placed with dead reckoning."""
        return self._placed(self.dead_reckoning)

    @cached_property
    def beams_ground_truth(self) -> np.ndarray | None:
        """Placed where they really were; NaN where that is not known."""
        return None if self.ground_truth is None else self._placed(self.ground_truth)

    # The seabed: what all beams but the held-out ones say, placed with the estimate. `map` is the
    # best particle's own, by whatever engine the particles have.

    @property
    def seabed_map(self) -> SurveyMap | None:
        """The seabed at any place; None where there is none."""
        return self._seabed_map_or_why_not[0]

    @property
    def why_no_seabed(self) -> str:
        """What the seabed lacks; empty where there is one."""
        return self._seabed_map_or_why_not[1]

    @cached_property
    def seabed(self) -> GridMap | None:
        """The seabed on the cells of `map`, NaN where no beam fell; None where there is none."""
        if self.seabed_map is None:
            return None
        x, y = self.map.x, self.map.y
        mean, variance = self.seabed_map.predict(grid_points(x, y))
        return GridMap(x, y, mean.reshape(len(x), len(y)), variance.reshape(len(x), len(y)))

    @cached_property
    def _seabed_map_or_why_not(self) -> tuple[SurveyMap | None, str]:
        if min(len(self.map.x), len(self.map.y)) < 2:
            return None, "the map has no grid that says how fine it should be"
        known = np.isfinite(self.beams).all(axis=1) & ~self.held_out[self.ping_of_beam]
        cell_m = np.array([self.map.x[0], self.map.y[0]])  # the cells' centres are nodes
        try:
            return SurveyMap(self.beams[known], self.map.resolution_m, cell_m), ""
        except ValueError as error:
            return None, str(error)

    def _placed(self, poses: np.ndarray) -> np.ndarray:
        return place_beams(self.levelled, self.ping_of_beam, poses)


def place_beams(levelled: np.ndarray, ping_of_beam: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """Beams [N, 3] in map from levelled ones, with the pings at poses [P, 6]."""
    x, y, yaw = (poses[ping_of_beam, i] for i in (0, 1, 5))
    forward, left, z = levelled.T
    cos_yaw, sin_yaw = np.cos(yaw), np.sin(yaw)
    placed = [x + cos_yaw * forward - sin_yaw * left, y + sin_yaw * forward + cos_yaw * left, z]
    return np.stack(placed, axis=-1)


def _check_shape(name: str, array: np.ndarray, expected: tuple[int, ...]) -> None:
    if np.shape(array) != expected:
        raise ValueError(f"{name}: expected shape {expected}, got {np.shape(array)}")
