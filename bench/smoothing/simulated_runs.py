"""Simulated surveys as run folders have them when no filter has run: dead reckoning and beams."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Callable

import numpy as np
from scipy.ndimage import median_filter

from bench.smoothing import seabeds
from rbpf_svgp_slam.bags.recorded_survey import Trajectory, rotation_from_rpy
from rbpf_svgp_slam.run.survey_run import GridMap, SurveyRun
from rbpf_svgp_slam.simulation import sonar
from rbpf_svgp_slam.simulation.mission import Mission, get_mission
from rbpf_svgp_slam.simulation.simulation import Survey, simulate_survey
from rbpf_svgp_slam.simulation.terrain import Terrain, save_terrain
from rbpf_svgp_slam.simulation.vehicle import levelling_rotation

MISSION = "lolo3"
#: A real seabed, if it is at hand: see the README of the data.
REAL_SEABED = Path(__file__).parents[3] / "shared" / "data" / "block_b_1m.npz"
SEABEDS: dict[str, Callable[[Mission, int], Terrain] | None] = {
    "fractal relief with dunes": None,  # the simulator's own
    "rippled dunes": seabeds.rippled_dunes,
    "nearly flat": seabeds.nearly_flat,
    "block_b": None,
}
#: As config/default.yaml has them (group pings).
OUTLIER_WINDOW, OUTLIER_THRESHOLD = 9, 8.0
_MAD_TO_STD, _LEAST_STD_M = 1.4826, 0.05


def simulated_run(seabed: str, seed: int, scale: float, mission_name: str = MISSION) -> SurveyRun:
    """Return the mission over the named seabed with 1 % outliers; its estimate: dead reckoning."""
    mission = get_mission(mission_name, scale)
    maker = SEABEDS[seabed]
    if maker is None:
        return as_run(simulate_survey(mission, seed, REAL_SEABED if seabed == "block_b" else None))
    with tempfile.NamedTemporaryFile(suffix=".npz") as file:
        save_terrain(file.name, maker(mission, seed))
        return as_run(simulate_survey(mission, seed, Path(file.name)))


def as_run(survey: Survey) -> SurveyRun:
    """Return the survey with its beams levelled and its outliers refused, as the core does it."""
    stamp_s = survey.pings.time_s
    dead_reckoning, truth = (_poses(track, stamp_s) for track in (survey.odometry, survey.truth))
    to_base = rotation_from_rpy(np.atleast_2d(sonar.MOUNT_RPY_RAD))
    to_level = levelling_rotation(dead_reckoning[:, 3:])
    pings = []
    for k, points_m in enumerate(survey.pings.points_m):
        seen_m = points_m[np.isfinite(points_m).all(axis=1)].astype(float)
        level_m = to_level[k].apply(to_base.apply(seen_m) + sonar.MOUNT_TRANSLATION_M)
        level_m[:, 2] += dead_reckoning[k, 2]
        pings.append(level_m[~_outliers(level_m[:, 2])].astype(np.float32))
    noise = survey.mission.dead_reckoning
    return SurveyRun(
        stamp_s=stamp_s,
        estimate=dead_reckoning,
        dead_reckoning=dead_reckoning,
        ground_truth=truth,
        levelled=np.concatenate(pings),
        ping_of_beam=np.repeat(np.arange(len(pings)), [len(ping) for ping in pings]),
        held_out=np.zeros(len(pings), dtype=bool),
        map=GridMap(np.empty(0), np.empty(0), np.empty((0, 0))),
        predict=lambda xy: (np.full(len(xy), np.nan), np.full(len(xy), np.nan)),
        noise_variance_m2=np.nan,
        support_points=np.empty((0, 3)),
        # As the overlay that comes beside a simulated bag.
        config={
            "motion": {
                "surge_std_m": noise.surge_m_per_sqrt_s,
                "sway_std_m": noise.sway_m_per_sqrt_s,
                "yaw_std_rad": noise.yaw_rad_per_sqrt_s,
            }
        },
    )


def _poses(track: Trajectory, stamp_s: np.ndarray) -> np.ndarray:
    position_m, rpy_rad = track.poses_at(stamp_s)
    return np.column_stack([position_m, rpy_rad])


def _outliers(z_m: np.ndarray) -> np.ndarray:
    """Which beams of a ping are far from the running median, by the ping's own deviation."""
    off_m = np.abs(z_m - median_filter(z_m, OUTLIER_WINDOW, mode="nearest"))
    std_m = max(_LEAST_STD_M, _MAD_TO_STD * float(np.median(off_m)))
    return off_m > OUTLIER_THRESHOLD * std_m
