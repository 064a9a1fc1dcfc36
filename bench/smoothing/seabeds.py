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
#: One on 150 m2; domes, half as high as their radius.
BOULDERS_PER_M2, BOULDER_RADII_M = 1 / 150, (0.5, 2.0)
#: Metres up per metre.
SLOPE = 0.05


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


def boulder_field(mission: Mission, seed: int) -> Terrain:
    """Return a nearly flat seabed with boulders on it, half buried."""
    rng = np.random.default_rng(seed)
    below = _generated(mission, rng, NEARLY_FLAT)
    z_m = below.z_m.astype(float)
    shape = np.array(z_m.shape)
    count = round(BOULDERS_PER_M2 * float(np.prod(shape)) * below.resolution_m**2)
    radii_m = rng.uniform(*BOULDER_RADII_M, count)
    for node, radius_m in zip(rng.uniform(0, shape, (count, 2)), radii_m):
        reach = int(np.ceil(radius_m / below.resolution_m))
        low = np.maximum(np.floor(node).astype(int) - reach, 0)
        high = np.minimum(np.ceil(node).astype(int) + reach + 1, shape)
        i, j = np.ogrid[low[0] : high[0], low[1] : high[1]]
        off_m = below.resolution_m * np.hypot(i - node[0], j - node[1])
        dome_m = np.sqrt(np.maximum(radius_m**2 - off_m**2, 0.0)) / 2
        under = z_m[low[0] : high[0], low[1] : high[1]]
        np.maximum(under, below.z_m[tuple(node.astype(int))] + dome_m, out=under, where=dome_m > 0)
    return Terrain(z_m.astype(np.float32), below.resolution_m, below.origin_m)


def slope(mission: Mission, seed: int) -> Terrain:
    """Return a slope with hardly any relief: it tells the place down it, not the one along it."""
    rng = np.random.default_rng(seed)
    below = _generated(mission, rng, NEARLY_FLAT)
    heading_rad = rng.uniform(0, 2 * np.pi)
    x, y = (below.resolution_m * (np.arange(n) - 0.5 * n) for n in below.z_m.shape)
    rise_m = np.cos(heading_rad) * x[:, None] + np.sin(heading_rad) * y
    return Terrain(
        (below.z_m + SLOPE * rise_m).astype(np.float32), below.resolution_m, below.origin_m
    )


def _generated(mission: Mission, rng: np.random.Generator, relief: Relief) -> Terrain:
    lower_m = -mission.margin_m * np.ones(2)
    upper_m = np.array(mission.area_m) + mission.margin_m
    resolution_m, mean_m = mission.terrain_resolution_m, mission.seabed_m
    return generate_terrain(lower_m, upper_m, resolution_m, mean_m, rng, relief)
