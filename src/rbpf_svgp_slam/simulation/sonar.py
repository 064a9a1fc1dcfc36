"""A multibeam echosounder: its mount, its fan, ray casting on the terrain, noise and outliers.

Sensor frame: parallel to base_link (x forward, y left, z up) but for the mounting roll.
"""

import dataclasses
import math

import numpy as np
from scipy.spatial.transform import Rotation

from rbpf_svgp_slam.bags.recorded_survey import rotation_from_rpy
from rbpf_svgp_slam.simulation import SurveyError

MOUNT_TRANSLATION_M = (0.5, 0.0, -0.1)  # mbes in base_link
MOUNT_RPY_RAD = (math.radians(2.0), 0.0, 0.0)  # mbes -> base_link

_PINGS_PER_BATCH = 256  # keeps the ray caster's arrays within some 10 MB
_FIRST_PING_S = 0.117  # off the odometry's stamps
_JITTER_S = 0.004


@dataclasses.dataclass(frozen=True)
class SonarNoise:
    """Errors of one beam."""

    range_fraction: float = 0.002  # standard deviation over range
    angle_rad: float = math.radians(0.1)  # standard deviation at nadir, grows as 1 / cos(angle)
    outlier_share: float = 0.01  # false detections: uniform over 0.3 to 1.3 of the true range
    nan_share: float = 0.002  # beams without detection that are reported all the same


@dataclasses.dataclass(frozen=True)
class Pings:
    """time_s [P]; points_m: P arrays [beams kept, 3] float32 in the sensor frame, port first.

    box_m [2, 2]: the lowest and the highest x, y of all noise-free footprints in the map frame.
    """

    time_s: np.ndarray
    points_m: list
    box_m: np.ndarray

    @property
    def beams(self):
        """How many beams all pings have together."""
        return sum(len(points_m) for points_m in self.points_m)


def beam_angles_rad(beams, swath_rad):
    """Equiangular beams [B] from port (positive) to starboard."""
    return np.linspace(0.5 * swath_rad, -0.5 * swath_rad, beams)


def beam_directions(angles_rad):
    """Unit vectors [..., 3] in the sensor frame: across track only, nadir is -z."""
    zeros = np.zeros_like(angles_rad)
    return np.stack([zeros, np.sin(angles_rad), -np.cos(angles_rad)], axis=-1)


def cast_rays(terrain, origins_m, directions, max_range_m):
    """Ranges [N] from origins [N, 3] along unit directions [N, 3]; NaN where nothing is hit.

    March in steps of at most a cell until the ray is below the surface, then bisect. Each ray
    starts where it comes below the terrain's highest point. Crests that a ray cuts for less than
    a cell's width can be missed.
    """
    sink = np.minimum(directions[:, 2], -1e-6)
    top_m, bottom_m = np.nanmax(terrain.z_m) + 0.01, np.nanmin(terrain.z_m) - 0.01
    near_m = np.maximum((top_m - origins_m[:, 2]) / sink, 0.0)
    far_m = np.minimum((bottom_m - origins_m[:, 2]) / sink, max_range_m)
    across = np.hypot(directions[:, 0], directions[:, 1])
    steps = np.ceil((far_m - near_m) * across / terrain.resolution_m).clip(min=1)
    step_m = (far_m - near_m) / steps

    def clearance_m(rays, range_m):
        x, y, z = (origins_m[rays] + range_m[:, None] * directions[rays]).T
        height_m = terrain.height_m(x, y)
        _reject_holes(terrain, x, y, height_m)
        return z - height_m

    ranges_m = np.full(len(origins_m), np.nan)
    rays = np.flatnonzero(far_m > near_m)
    above = clearance_m(rays, near_m[rays]) > 0
    for k in range(1, int(steps.max()) + 1):
        range_m = near_m[rays] + k * step_m[rays]
        gap_m = clearance_m(rays, range_m)
        below = gap_m <= 0
        # Off the grid the clearance is NaN, neither above nor below: a ray that comes in over the
        # edge already below the surface has hit nothing.
        hit = above & below
        ranges_m[rays[hit]] = _bisect(clearance_m, rays[hit], range_m[hit], step_m[rays[hit]])
        marching = ~below & (k < steps[rays])
        rays, above = rays[marching], gap_m[marching] > 0
    return ranges_m


def _bisect(clearance_m, rays, below_m, step_m):
    """Ranges in (below - step, below] at which the rays meet the surface, to the millimetre."""
    above_m = below_m - step_m
    while np.max(below_m - above_m, initial=0.0) > 2e-3:
        middle_m = 0.5 * (above_m + below_m)
        below = clearance_m(rays, middle_m) <= 0
        below_m, above_m = np.where(below, middle_m, below_m), np.where(below, above_m, middle_m)
    return 0.5 * (above_m + below_m)


def _reject_holes(terrain, x_m, y_m, height_m):
    holes = np.isnan(height_m)
    if not holes.any():
        return
    holes &= terrain.contains(x_m, y_m)
    if holes.any():
        x, y = x_m[holes][0], y_m[holes][0]
        raise SurveyError(
            f"terrain is NaN under the swath at x = {x:.1f} m, y = {y:.1f} m; "
            "expected finite heights under the whole swath"
        )


def simulate_pings(terrain, truth, mission, noise, rng, progress=lambda share: None):
    """All Pings of a vehicle moving along the Trajectory `truth` over the terrain."""
    time_s = np.arange(_FIRST_PING_S, truth.time_s[-1] - _JITTER_S, 1 / mission.ping_rate_hz)
    # Triggers wander: a filter must use each ping's own stamp.
    time_s = time_s + rng.uniform(-_JITTER_S, _JITTER_S, len(time_s))
    angles_rad = beam_angles_rad(mission.beams, mission.swath_rad)
    points_m, corners_m = [], []
    for first in range(0, len(time_s), _PINGS_PER_BATCH):
        batch = slice(first, first + _PINGS_PER_BATCH)
        position_m, rpy_rad = truth.poses_at(time_s[batch])
        ranges_m, footprints_m = _true_beams(
            terrain, position_m, rpy_rad, angles_rad, mission.max_range_m
        )
        seen_m = footprints_m[~np.isnan(footprints_m[:, 0])]
        if len(seen_m):
            corners_m += [seen_m.min(axis=0), seen_m.max(axis=0)]
        measured_m = _measure(ranges_m, angles_rad, mission.max_range_m, noise, rng)
        points_m += [ping_m[~np.isnan(range_m)] for ping_m, range_m in zip(measured_m, ranges_m)]
        progress(len(points_m) / len(time_s))
    if not corners_m:
        raise SurveyError(
            f"no beam meets the terrain within {mission.name}'s range of {mission.max_range_m} m"
        )
    box_m = np.array([np.min(corners_m, axis=0), np.max(corners_m, axis=0)])
    return Pings(time_s, points_m, box_m)


def _true_beams(terrain, position_m, rpy_rad, angles_rad, max_range_m):
    """Noise-free ranges [P, B] and footprints [P * B, 2] of pings at P poses of base_link."""
    to_map = rotation_from_rpy(rpy_rad)
    origins_m = position_m + to_map.apply(MOUNT_TRANSLATION_M)
    mounted = Rotation.from_euler("xyz", MOUNT_RPY_RAD).apply(beam_directions(angles_rad))
    directions = np.einsum("pij,bj->pbi", to_map.as_matrix(), mounted).reshape(-1, 3)
    origins_m = np.repeat(origins_m, len(angles_rad), axis=0)
    ranges_m = cast_rays(terrain, origins_m, directions, max_range_m)
    footprints_m = (origins_m + ranges_m[:, None] * directions)[:, :2]
    return ranges_m.reshape(len(position_m), -1), footprints_m


def _measure(ranges_m, angles_rad, max_range_m, noise, rng):
    """Points [P, B, 3] float32 in the sensor frame as the sonar reports them."""
    shape = ranges_m.shape
    measured_m = ranges_m * (1 + noise.range_fraction * rng.standard_normal(shape))
    spread_rad = noise.angle_rad / np.cos(angles_rad)
    measured_rad = angles_rad + spread_rad * rng.standard_normal(shape)
    outlier = rng.random(shape) < noise.outlier_share
    false_m = np.minimum(ranges_m * rng.uniform(0.3, 1.3, shape), max_range_m)
    measured_m = np.where(outlier, false_m, measured_m)
    measured_m[rng.random(shape) < noise.nan_share] = np.nan
    return (measured_m[..., None] * beam_directions(measured_rad)).astype(np.float32)
