"""Seabeds that are hard to find one's place on."""

from __future__ import annotations

import numpy as np

from rbpf_svgp_slam.simulation.mission import Mission
from rbpf_svgp_slam.simulation.terrain import Relief, Terrain, generate_terrain

#: Hardly any relief: 0.1 m between what is low and what is high.
NEARLY_FLAT = Relief(longest_m=60.0, fractal_m=0.033, dunes_m=0.0)
#: Under the ripples: long waves, and dunes.
LONG_WAVES = Relief(longest_m=120.0, fractal_m=0.5, dunes_m=0.3)
#: Of the ripples, whose crests wander to either side over some distance along them.
WAVELENGTH_M, AMPLITUDE_M = 10.0, 0.25
WANDER_M, WANDER_LENGTH_M = 1.5, 80.0


def nearly_flat(mission: Mission, seed: int) -> Terrain:
    """Return the mission's seabed with NEARLY_FLAT's relief."""
    return _generated(mission, np.random.default_rng(seed), NEARLY_FLAT)


def rippled_dunes(mission: Mission, seed: int) -> Terrain:
    """Return dunes with ripples on them, of one wavelength: one crest looks like the next."""
    rng = np.random.default_rng(seed)
    below = _generated(mission, rng, LONG_WAVES)
    heading_rad = rng.uniform(0, np.pi)
    x, y = (
        below.origin_m[axis] + below.resolution_m * np.arange(below.z_m.shape[axis])
        for axis in (0, 1)
    )
    across_m = np.cos(heading_rad) * x[:, None] + np.sin(heading_rad) * y
    along_m = np.cos(heading_rad) * y - np.sin(heading_rad) * x[:, None]
    phase = 2 * np.pi * along_m / WANDER_LENGTH_M + rng.uniform(0, 2 * np.pi)
    crests_m = across_m + WANDER_M * np.sin(phase)
    ripples_m = AMPLITUDE_M * np.sin(2 * np.pi * crests_m / WAVELENGTH_M)
    z_m = below.z_m + ripples_m
    return Terrain(z_m.astype(np.float32), below.resolution_m, below.origin_m)


def _generated(mission: Mission, rng: np.random.Generator, relief: Relief) -> Terrain:
    lower_m = -mission.margin_m * np.ones(2)
    upper_m = np.array(mission.area_m) + mission.margin_m
    resolution_m, mean_m = mission.terrain_resolution_m, mission.seabed_m
    return generate_terrain(lower_m, upper_m, resolution_m, mean_m, rng, relief)
