"""Simulated surveys: lawn-mower lines over generated relief, beams in their order of arrival."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rbpf_svgp_slam.simulation.terrain import Terrain, generate_terrain

AREA_M = (200.0, 150.0)
SEABED_M = -30.0
RESOLUTION_M = 0.5
NOISE_STD_M = 0.15
SPEED_MPS = 1.5
LINE_SPACING_M = 15.0
ALTITUDE_M = 14.0
#: Half of the swath's opening angle, rad.
HALF_SWATH_RAD = np.deg2rad(60.0)
HELD_OUT = 20_000
#: Number of lines, and how long they take with the ways from one to the next, s.
LINES = round(AREA_M[1] / LINE_SPACING_M) - 1
DURATION_S = (LINES * (AREA_M[0] + LINE_SPACING_M) - LINE_SPACING_M) / SPEED_MPS
#: The relief changes over this distance, m.
TRANSITION_M = 10.0


@dataclass(frozen=True)
class Beams:
    """Beams [n, 3] (x, y, z), m, in order of arrival, and their times [n], s."""

    xyz_m: np.ndarray
    arrival_s: np.ndarray

    def until(self, time_s: float) -> np.ndarray:
        """Those [n, 3] that have arrived by then."""
        return self.xyz_m[: np.searchsorted(self.arrival_s, time_s, side="right")]


@dataclass(frozen=True)
class BenchSurvey:
    """A survey's beams for training, and those that are kept apart to measure errors with."""

    area_m: np.ndarray  #: corners [4, 2]
    training: Beams
    held_out: Beams


def smooth_relief(seed: int) -> Terrain:
    """The package's own relief: several metres high, features of 15 to 80 m."""
    return generate_terrain((0, 0), AREA_M, RESOLUTION_M, SEABED_M, np.random.default_rng(seed))


def relief_that_turns_rough(seed: int) -> Terrain:
    """The same up to half of y; beyond it higher, 2 m shallower and with features half as wide."""
    smooth = smooth_relief(seed)
    rng = np.random.default_rng([seed, 1])
    wide = generate_terrain((0, 0), 2 * np.array(AREA_M), 2 * RESOLUTION_M, 0.0, rng)
    y_m = smooth.origin_m[1] + RESOLUTION_M * np.arange(smooth.z_m.shape[1])
    share = 1.0 / (1.0 + np.exp(-(y_m - 0.5 * AREA_M[1]) / (0.25 * TRANSITION_M)))
    z_m = (1.0 - share) * smooth.z_m + share * (SEABED_M + 2.0 + 1.3 * wide.z_m)
    return Terrain(z_m.astype(np.float32), RESOLUTION_M, smooth.origin_m)


def run_survey(terrain: Terrain, beams: int, seed: int) -> BenchSurvey:
    """Lines along x, from the lowest y to the highest; `beams` beams to train with."""
    rng = np.random.default_rng([seed, 2])
    count = beams + HELD_OUT
    # twice as many as needed: the swath of the outermost lines leaves the area
    time_s = np.sort(rng.uniform(0.0, DURATION_S, 2 * count))
    x_m, line_y_m = _vehicle_m(time_s)
    y_m = line_y_m + ALTITUDE_M * np.tan(rng.uniform(-HALF_SWATH_RAD, HALF_SWATH_RAD, len(time_s)))
    inside = np.flatnonzero((y_m > 0.0) & (y_m < AREA_M[1]))
    chosen = np.sort(rng.choice(inside, count, replace=False))
    time_s, x_m, y_m = time_s[chosen], x_m[chosen], y_m[chosen]
    z_m = terrain.height_m(x_m, y_m) + NOISE_STD_M * rng.standard_normal(count)
    beams_m = np.column_stack([x_m, y_m, z_m])
    apart = rng.permutation(count) < HELD_OUT
    width_m, height_m = AREA_M
    corners_m = np.array([[0, 0], [width_m, 0], [width_m, height_m], [0, height_m]], dtype=float)
    training, held_out = (Beams(beams_m[part], time_s[part]) for part in (~apart, apart))
    return BenchSurvey(corners_m, training, held_out)


def _vehicle_m(time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The vehicle's x [n] and y [n] at times [n]: back and forth along x, then on to the next."""
    length_m = AREA_M[0] + LINE_SPACING_M
    line, along_m = np.divmod(SPEED_MPS * time_s, length_m)
    x_m = np.minimum(along_m, AREA_M[0])
    x_m = np.where(line % 2 == 0, x_m, AREA_M[0] - x_m)
    y_m = LINE_SPACING_M * (1 + line) + np.maximum(along_m - AREA_M[0], 0.0)
    return x_m, y_m
