"""What is exported of a run folder: the seabed, the beams it is made of, and the track.

Shapes: P pings, N beams.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from rbpf_svgp_slam.charts.charted_seabed import ChartedSeabed, where_beams_fell
from rbpf_svgp_slam.run.run_files import RunFolderError, load_npz, load_text, poses_at
from rbpf_svgp_slam.run.survey_run import GridMap, place_beams

_SURVEY = ("stamp_s", "held_out", "beams_per_ping", "levelled")
_SPACING_TOLERANCE = 1e-6


@dataclass
class ExportedRun(ChartedSeabed):
    """One run. Frame map, m, rad, z up."""

    folder: Path
    source: str  # the file that the seabed is from
    stamp_s: np.ndarray  # [P]
    config: dict[str, Any]  # its parameters


def load_exported_run(folder: Path) -> ExportedRun:
    """The run in a folder, ours or another program's.

    seabed.npz is taken, or map.npz where there is none. Raises RunFolderError with the file and
    what was expected of it.
    """
    if not folder.is_dir():
        raise RunFolderError(f"{folder}: no such folder; expected a run folder")
    survey = load_npz(folder / "survey.npz", _SURVEY)
    stamp_s = survey["stamp_s"]
    poses = _poses(folder / "trajectory.tum", stamp_s)
    try:
        ping_of_beam = np.repeat(np.arange(len(stamp_s)), survey["beams_per_ping"])
        beams = place_beams(survey["levelled"].astype(float), ping_of_beam, poses)
        used = np.isfinite(beams).all(axis=1) & ~survey["held_out"].astype(bool)[ping_of_beam]
    except (IndexError, TypeError, ValueError) as error:
        raise RunFolderError(f"{folder}/survey.npz: expected beams of pings ({error})") from error
    beams, ping_of_beam = beams[used], ping_of_beam[used]
    source, seabed, noise_variance_m2 = _seabed(folder, beams)
    return ExportedRun(
        folder=folder,
        source=source,
        seabed=seabed,
        noise_variance_m2=noise_variance_m2,
        stamp_s=stamp_s,
        poses=poses,
        covariance=_covariance(folder, survey, len(stamp_s)),
        beams=beams,
        ping_of_beam=ping_of_beam,
        config=load_text(folder / "parameters.yaml", yaml.safe_load),
    )


def _poses(path: Path, stamp_s: np.ndarray) -> np.ndarray:
    """Poses [P, 6], of which some are known."""
    try:
        poses = poses_at(path, stamp_s)
    except (IndexError, TypeError, ValueError) as error:
        where = "" if str(error).startswith(str(path)) else f"{path}: expected poses: "
        raise RunFolderError(f"{where}{error}") from error
    if not np.isfinite(poses).all(axis=1).any():
        raise RunFolderError(f"{path}: has no pose at a stamp of survey.npz; expected the pings'")
    return poses


def _seabed(folder: Path, beams: np.ndarray) -> tuple[str, GridMap, float]:
    """The file's name, its seabed where beams [N, 3] fell, and the noise variance of a beam."""
    path = folder / "seabed.npz"
    if path.is_file():
        file = load_npz(path, ("x", "y", "mean", "std", "noise_std_m"))
        variance, noise_variance_m2 = np.square(file["std"]), float(file["noise_std_m"]) ** 2
        return path.name, _grid(path, file, variance), noise_variance_m2
    path = folder / "map.npz"
    file = load_npz(path, ("x", "y", "mean", "variance"))
    grid = _grid(path, file, file["variance"])
    return path.name, where_beams_fell(grid, beams), float(file.get("noise_variance_m2", 0.0))


def _grid(path: Path, file: dict[str, np.ndarray], variance: np.ndarray) -> GridMap:
    try:
        grid = GridMap(file["x"], file["y"], file["mean"].astype(float), variance.astype(float))
    except (TypeError, ValueError) as error:
        raise RunFolderError(f"{path}: {error}") from error
    for name in ("x", "y"):
        steps = np.diff(getattr(grid, name))
        if not len(steps) or steps[0] <= 0 or not np.allclose(steps, steps[0], _SPACING_TOLERANCE):
            raise RunFolderError(f"{path}: expected at least two even steps along {name}")
    if not np.isfinite(grid.mean).any():
        raise RunFolderError(f"{path}: expected a seabed; mean has no finite value")
    return grid


def _covariance(folder: Path, survey: dict[str, np.ndarray], pings: int) -> np.ndarray | None:
    covariance = survey.get("estimate_covariance")
    if covariance is not None and covariance.shape != (pings, 6):
        raise RunFolderError(
            f"{folder}/survey.npz: estimate_covariance has shape {covariance.shape}; expected "
            f"{(pings, 6)}"
        )
    return covariance
