"""Simulated surveys with every beam where it truly fell, ping by ping."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Callable

import numpy as np

from rbpf_svgp_slam.bags.recorded_survey import rotation_from_rpy
from rbpf_svgp_slam.simulation import sonar
from rbpf_svgp_slam.simulation.mission import get_mission
from rbpf_svgp_slam.simulation.simulation import simulate_survey

HELD_OUT = 0.02  # of the pings
#: Beams that a map takes in at once, as in the map nodes.
BLOCK_BEAMS = 1024


#: A held-out beam further from the true seabed is a false detection.
LARGEST_ERROR_M = 0.6


@dataclass(frozen=True)
class PlacedSurvey:
    """Beams [n, 3] (x, y, z), m, relative to the middle of the survey."""

    pings: list[np.ndarray]  # to map
    held_out: np.ndarray  # of other pings, without outliers
    seabed_m: Callable[[np.ndarray], np.ndarray]  # true z [n] at points [n, 2]

    @property
    def beams(self) -> np.ndarray:
        """All beams that are to be mapped."""
        return np.concatenate(self.pings)

    def blocks(self) -> list[np.ndarray]:
        """The same, in blocks of whole pings."""
        pings = max(1, BLOCK_BEAMS // max(map(len, self.pings)))
        starts = range(0, len(self.pings), pings)
        return [np.concatenate(self.pings[start : start + pings]) for start in starts]


def placed_survey(
    mission: str, seed: int, scale: float = 1.0, terrain: Path | None = None, outliers: float = 0.01
) -> PlacedSurvey:
    """The mission over generated terrain or over that of a file."""
    noise = sonar.SonarNoise(outlier_share=outliers)
    survey = simulate_survey(get_mission(mission, scale), seed, terrain, noise)
    position_m, rpy_rad = survey.truth.poses_at(survey.pings.time_s)
    to_map = rotation_from_rpy(rpy_rad)
    to_base = rotation_from_rpy(np.atleast_2d(sonar.MOUNT_RPY_RAD))
    middle_m = np.append(position_m[:, :2].mean(0), 0.0)

    def seabed_m(xy: np.ndarray) -> np.ndarray:
        return survey.terrain.height_m(*(xy + middle_m[:2]).T)

    pings, held_out = [], []
    apart = np.random.default_rng(seed).random(len(position_m)) < HELD_OUT
    for k, points_m in enumerate(survey.pings.points_m):
        seen_m = points_m[np.isfinite(points_m).all(axis=1)].astype(float)
        base_m = to_base.apply(seen_m) + sonar.MOUNT_TRANSLATION_M
        beams = to_map[k].apply(base_m) + position_m[k] - middle_m
        if apart[k]:
            held_out.append(beams[np.abs(beams[:, 2] - seabed_m(beams[:, :2])) < LARGEST_ERROR_M])
        else:
            pings.append(beams)
    return PlacedSurvey(pings, np.concatenate(held_out), seabed_m)
