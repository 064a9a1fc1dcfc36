"""The surveys of the study: seabed, outliers, dead reckoning and lines.

A case is named by what differs from the base, joined by '+': `base`, `rippled`, `cheap+outliers5`.
"""

from __future__ import annotations

import dataclasses
import itertools
import tempfile
from pathlib import Path
from typing import Callable

from bench.smoothing import seabeds
from bench.smoothing.simulated_runs import REAL_SEABED
from rbpf_svgp_slam.simulation.dead_reckoning import DeadReckoningNoise
from rbpf_svgp_slam.simulation.mission import Mission, get_mission
from rbpf_svgp_slam.simulation.simulation import Survey, simulate_survey
from rbpf_svgp_slam.simulation.sonar import SonarNoise
from rbpf_svgp_slam.simulation.terrain import Terrain, save_terrain

#: lolo3's fan covers so many metres of a flat seabed: 14 m above it, 120 degrees.
SWATH_M = 48.5
#: Of lolo3's lines: some 22 minutes.
BASE_SCALE = 0.64


@dataclasses.dataclass(frozen=True)
class Lines:
    """Where the vehicle goes: parallel lines, and lines across them if there are any."""

    area_m: tuple[float, float]
    spacing_m: float
    crossing_m: float = float("inf")


def _parallel(lines: int, length_m: float, overlap: float) -> Lines:
    """Lines whose swaths share `overlap` of their width, with a way back and nothing across."""
    spacing_m = (1.0 - overlap) * SWATH_M
    return Lines((length_m + 30.0, (lines - 1) * spacing_m + 30.0), spacing_m)


#: None: the mission's own, with relief that no method fails on.
SEABEDS: dict[str, Callable[[Mission, int], Terrain] | None] = {
    "fractal": None,
    "rippled": seabeds.rippled_dunes,
    "flat": seabeds.nearly_flat,
    "block_b": None,
    "boulders": seabeds.boulder_field,
    "slope": seabeds.slope,
}
OUTLIERS = {"outliers1": 0.01, "outliers0": 0.0, "outliers5": 0.05}
DEAD_RECKONING = {
    "usual": None,  # the mission's own
    # a fibre-optic gyro and a Doppler log that has the bottom
    "fog": DeadReckoningNoise(
        surge_m_per_sqrt_s=0.05,
        sway_m_per_sqrt_s=0.05,
        yaw_rad_per_sqrt_s=1e-4,
        surge_scale=0.003,
        gyro_bias_radps=2e-6,
    ),
    # a cheap gyro, and velocity through water that flows
    "cheap": DeadReckoningNoise(
        yaw_rad_per_sqrt_s=0.0025,
        surge_scale=0.01,
        gyro_bias_radps=5e-5,
        velocity_bias_mps=0.01,
        current_mps=0.02,
    ),
}
LINES = {
    "crossed": None,  # the mission's own
    "overlap50": _parallel(5, 270.0, 0.5),
    "overlap10": _parallel(4, 270.0, 0.1),
    "overlap0": _parallel(3, 370.0, -0.05),
}
_FACTORS = (SEABEDS, OUTLIERS, DEAD_RECKONING, LINES)


@dataclasses.dataclass(frozen=True)
class Case:
    """Names of the four tables above."""

    seabed: str = "fractal"
    outliers: str = "outliers1"
    dead_reckoning: str = "usual"
    lines: str = "crossed"

    @property
    def name(self) -> str:
        """What differs from the base."""
        levels = dataclasses.astuple(self)
        differing = [
            level for level, base in zip(levels, dataclasses.astuple(BASE)) if level != base
        ]
        return "+".join(differing) or "base"

    def survey(self, seed: int, scale: float = BASE_SCALE) -> Survey:
        """Simulate it: the same seed drifts alike over every seabed.

        scale: of lolo3's own lines; the other lines are as long as they are.
        """
        mission = get_mission("lolo3", scale)
        changes: dict = {}
        if (lines := LINES[self.lines]) is not None:
            changes["area_m"] = lines.area_m
            changes["line_spacing_m"] = lines.spacing_m
            changes["crossing_spacing_m"] = lines.crossing_m
        if (noise := DEAD_RECKONING[self.dead_reckoning]) is not None:
            changes["dead_reckoning"] = noise
        mission = dataclasses.replace(mission, **changes)
        sonar = SonarNoise(outlier_share=OUTLIERS[self.outliers])
        with tempfile.TemporaryDirectory() as folder:
            terrain = self._terrain(mission, seed, Path(folder))
            return simulate_survey(mission, seed, terrain, sonar)

    def _terrain(self, mission: Mission, seed: int, folder: Path) -> Path | None:
        if self.seabed == "block_b":
            return REAL_SEABED
        maker = SEABEDS[self.seabed]
        if maker is None:
            return None
        save_terrain(folder / "terrain.npz", maker(mission, seed))
        return folder / "terrain.npz"


BASE = Case()
#: Everything with everything.
ALL = [Case(*levels) for levels in itertools.product(*_FACTORS)]
_BY_NAME = {case.name: case for case in ALL}
#: The base, and whatever differs from it in one thing.
ONE_AT_A_TIME = [case for case in ALL if case.name.count("+") == 0]
#: Of ALL a ninth, in which any two levels of different factors meet at least once.
PAIRS = [
    Case(
        seabed,
        list(OUTLIERS)[(s + k) % 3],
        list(DEAD_RECKONING)[(s + s // 3 + 2 * k) % 3],
        lines,
    )
    for s, seabed in enumerate(SEABEDS)
    for k, lines in enumerate(LINES)
]
_SETS = {"all": ALL, "pairs": PAIRS, "single": ONE_AT_A_TIME}


def cases(names: list[str]) -> list[Case]:
    """Those of these names, or of one of _SETS. Raises ValueError."""
    if len(names) == 1 and names[0] in _SETS:
        return _SETS[names[0]]
    unknown = [name for name in names if name not in _BY_NAME]
    if unknown:
        levels = ", ".join(level for factor in _FACTORS for level in list(factor)[1:])
        raise ValueError(
            f"case is '{unknown[0]}', expected base, all, pairs, single, or one or more of "
            f"{levels}, in this order and joined by '+'"
        )
    return [_BY_NAME[name] for name in names]
