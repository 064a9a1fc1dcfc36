"""Puts together what the evaluation needs of a finished run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import rospy

from rbpf_svgp_slam.evaluation import GridMap, SurveyRun, interpolate_poses, write_tum
from rbpf_svgp_slam.msg import FilterStatus
from rbpf_svgp_slam.polygon import inside, survey_origin
from rbpf_svgp_slam.ros.survey_client import fetch_map, fetch_survey
from rbpf_svgp_slam.ros.survey_grid import cell_centres, grid_points

if TYPE_CHECKING:
    from rbpf_svgp_slam.ros.recorder import Recorder
    from rbpf_svgp_slam.ros.replay import OfflineReplay, PlayedBag

GRID_CHUNK = 20000  # positions predicted at a time


def assemble_run(recorder: Recorder, source: PlayedBag | OfflineReplay | None) -> SurveyRun:
    """Fetch the survey and the best particle's map, and evaluate the map on its grid."""
    status = recorder.statuses[-1]
    parameters = recorder.parameters
    survey = fetch_survey()
    _save_trajectories(recorder.out_dir, survey)
    engine = fetch_map(
        status.best_particle, status.epoch, parameters["particles"], parameters["nodes"]
    )
    origin = survey_origin(parameters["survey_area"])

    def predict(xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        parts = np.array_split(xy - origin, 1 + len(xy) // GRID_CHUNK)
        mean, variance = zip(*(engine.predict(part) for part in parts))
        return np.concatenate(mean), np.concatenate(variance)

    truth = None
    if recorder.ground_truth:
        track = np.asarray(sorted(recorder.ground_truth))
        truth = interpolate_poses(track[:, 0], track[:, 1:], survey.stamp_s)
    return SurveyRun(
        stamp_s=survey.stamp_s,
        estimate=survey.estimate,
        estimate_std_m=survey.estimate_std_m,
        dead_reckoning=survey.dead_reckoning,
        ground_truth=truth,
        beams=survey.place(survey.estimate),
        beams_dead_reckoning=survey.place(survey.dead_reckoning),
        beams_ground_truth=None if truth is None else survey.place(truth),
        ping_of_beam=survey.ping_of_beam,
        held_out=survey.held_out,
        map=_grid(parameters["survey_area"], parameters["map"]["resolution_m"], predict),
        predict=predict,
        noise_variance_m2=engine.noise_variance_m2,
        inducing_points=engine.support_points() + np.append(origin, 0.0),
        terrain=_terrain(recorder.terrain_file),
        statistics=_statistics(recorder, survey, source),
        status_history=_history(recorder.statuses),
        config=parameters,
    )


def _save_trajectories(out_dir: Path, survey: Any) -> None:
    """At once: a map that cannot be had must not cost the survey."""
    out_dir.mkdir(parents=True, exist_ok=True)
    write_tum(out_dir / "trajectory.tum", survey.stamp_s, survey.estimate)
    write_tum(out_dir / "dead_reckoning.tum", survey.stamp_s, survey.dead_reckoning)


def _grid(area: list, resolution_m: float, predict: Any) -> GridMap:
    """Mean and variance over the survey area; NaN outside."""
    x, y = cell_centres(area, resolution_m)
    points = grid_points(x, y)
    within = inside(points, np.asarray(area, dtype=float))
    mean, variance = np.full((2, len(points)), np.nan)
    mean[within], variance[within] = predict(points[within])
    return GridMap(x, y, mean.reshape(len(x), len(y)), variance.reshape(len(x), len(y)))


def _terrain(path: str) -> GridMap | None:
    """The true seabed beside a simulated bag."""
    if not path or not Path(path).is_file():
        return None
    with np.load(path) as file:
        z, resolution_m, origin_m = file["z"], float(file["resolution_m"]), file["origin_m"]
    x, y = (origin_m[i] + resolution_m * np.arange(z.shape[i]) for i in range(2))
    return GridMap(x, y, z.astype(float))


def _statistics(recorder: Recorder, survey: Any, source: Any) -> dict[str, Any]:
    status = recorder.statuses[-1]
    peaks_mb = [m.peak_rss_mb for m in recorder.map_statuses.values()] + [status.peak_rss_mb]
    dropped = max(int(status.pings_dropped), source.lost(status) if source else 0)
    if dropped:
        rospy.logwarn("%d pings were lost on the way in.", dropped)
    return {
        "particles": status.particles,
        "nodes": status.nodes,
        "seed": recorder.parameters["seed"],
        "pings": int(status.pings),
        "pings_dropped": dropped,
        "beams": len(survey.levelled),
        "duration_s": float(survey.stamp_s[-1] - survey.stamp_s[0]) if len(survey.stamp_s) else 0.0,
        "wall_s": recorder.wall_s,
        "iterations_total": sum(int(m.steps) for m in recorder.map_statuses.values()),
        "loop_closure_prompts": status.prompts,
        "resamplings": status.epoch,
        "maps_moved": status.maps_moved,
        "bytes_moved": int(status.bytes_moved),
        "prompt_s_median": _median(recorder.statuses, "prompt_s", "prompts"),
        "resampling_s_median": _median(recorder.statuses, "resampling_s", "epoch"),
        "peak_rss_mb": sum(peaks_mb),
    }


def _median(statuses: list[FilterStatus], field: str, count: str) -> float:
    """Of what a status says of the latest of something that it counts; NaN if there was none."""
    values = {getattr(status, count): getattr(status, field) for status in statuses}
    return float(np.median([values[n] for n in values if n > 0] or [np.nan]))


def _history(statuses: list) -> dict[str, np.ndarray]:
    series = {
        "n_eff": "n_eff",
        "iterations_total": "iterations",
        "ready_maps": "maps_ready",
        "loop_closure_prompts": "prompts",
        "resamplings": "epoch",
        "tau": "tempering",
        "overlap": "overlap",
    }
    live = [status for status in statuses if status.odometry_messages]
    history = {
        name: np.array([getattr(status, field) for status in live], dtype=float)
        for name, field in series.items()
    }
    history["t_s"] = np.array([status.header.stamp.to_sec() for status in live])
    return history
