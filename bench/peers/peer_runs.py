"""One peer on one survey: its run, as the package's evaluation takes it, and its report."""

from __future__ import annotations

import dataclasses
import time
from pathlib import Path
from typing import Any, Callable

import numpy as np

from bench.peers.grid_maps import GridMaps
from bench.peers.histories import Histories
from bench.peers.particle_filter import Maps, ParticleFilter
from bench.peers.patch_gp import PatchGp
from bench.peers.submap_graph import online_track
from bench.peers.tiled_gp import TiledGp
from rbpf_svgp_slam.metrics.consistency import ConsistencySettings
from rbpf_svgp_slam.metrics.evaluation import evaluate
from rbpf_svgp_slam.parameters.known import default_parameters
from rbpf_svgp_slam.run.survey_run import GridMap, SurveyRun
from rbpf_svgp_slam.run.tracks import write_tum
from rbpf_svgp_slam.smoothing.smooth_run import PLANAR, smooth_run
from rbpf_svgp_slam.smoothing.smoothing_parameters import smoothing_params
from rbpf_svgp_slam.survey_area.grid import cell_centres

#: J.
PARTICLES = 100
#: The study shows no consistency: as little as can be is spent on it.
_CONSISTENCY = ConsistencySettings(draws=1, max_beams=10_000)

MakeMaps = Callable[[SurveyRun, Histories, np.random.Generator], Maps]


def _grid(run: SurveyRun, histories: Histories, rng: np.random.Generator) -> GridMaps:
    reached_m = run.beams_dead_reckoning[:, :2]
    return GridMaps(histories, reached_m.min(axis=0), reached_m.max(axis=0))


MAPS: dict[str, MakeMaps] = {
    "grid": _grid,
    "gp_patch": lambda run, histories, rng: PatchGp(histories, rng),
    "gp_tiles": lambda run, histories, rng: TiledGp(histories),
}
PEERS = [*MAPS, "submaps"]


def peer_run(name: str, run: SurveyRun, seed: int, particles: int = PARTICLES) -> SurveyRun:
    """Return the survey's run by the peer of that name; the given one is dead reckoning's."""
    rng = np.random.default_rng(seed)
    share = default_parameters()["evaluation"]["holdout"]
    run = dataclasses.replace(run, held_out=rng.random(len(run.stamp_s)) < share)
    started_s = time.monotonic()
    if name == "submaps":
        run = _submaps(run)
    else:
        run = _filtered(run, MAPS[name], particles, rng)
    run.statistics["wall_s"] = time.monotonic() - started_s
    run.statistics["seed"] = seed
    return run


def report(run: SurveyRun) -> dict[str, Any]:
    """The fields of report.json, of a peer's run."""
    low_m, high_m = (bound(run.beams[:, :2], axis=0) for bound in (np.min, np.max))
    corners_m = [low_m, (low_m[0], high_m[1]), high_m, (high_m[0], low_m[1])]
    x, y = cell_centres(corners_m, default_parameters()["map"]["resolution_m"])
    seabed_cells = GridMap(x, y, np.full((len(x), len(y)), np.nan))
    return evaluate(dataclasses.replace(run, map=seabed_cells), _CONSISTENCY).report


def write_tracks(run: SurveyRun, folder: Path) -> None:
    """As a run folder has them."""
    write_tum(folder / "trajectory.tum", run.stamp_s, run.estimate)
    write_tum(folder / "online.tum", run.stamp_s, run.online)


def _filtered(
    run: SurveyRun, make_maps: MakeMaps, particles: int, rng: np.random.Generator
) -> SurveyRun:
    histories = Histories(run, particles)
    peer = ParticleFilter(run, histories, make_maps(run, histories, rng), rng)
    peer.run()
    final, covariance = histories.mean_and_covariance(np.arange(len(run.stamp_s)))
    return dataclasses.replace(
        run,
        estimate=_with_plane(run, final),
        estimate_covariance=covariance,
        online=_with_plane(run, peer.online),
        online_covariance=peer.online_covariance,
        statistics={
            "particles": particles,
            "loop_closure_prompts": peer.prompts,
            "resamplings": peer.resamplings,
        },
    )


def _submaps(run: SurveyRun) -> SurveyRun:
    online = _with_plane(run, online_track(run))
    smoothed, _ = smooth_run(run, smoothing_params(run.config))
    return dataclasses.replace(smoothed, online=online, statistics={})


def _with_plane(run: SurveyRun, planar: np.ndarray) -> np.ndarray:
    """Poses [P, 6] with these x, y, yaw [P, 3]; height, roll and pitch are measured."""
    poses = run.dead_reckoning.copy()
    poses[:, PLANAR] = planar
    return poses
