"""Puts together what the evaluation needs of a finished run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import rospy

from rbpf_svgp_slam.maps import load_map
from rbpf_svgp_slam.metrics.map_metrics import predict_in_chunks
from rbpf_svgp_slam.msg import FilterStatus
from rbpf_svgp_slam.parameters.rules import Polygon
from rbpf_svgp_slam.recorder.health import health
from rbpf_svgp_slam.recorder.map_sample import sampled_map_rmse
from rbpf_svgp_slam.recorder.provenance import provenance
from rbpf_svgp_slam.recorder.recording import Recording
from rbpf_svgp_slam.recorder.refusals import refusals
from rbpf_svgp_slam.recorder.survey_client import (
    fetch_closures,
    fetch_fixes,
    fetch_map,
    fetch_survey,
)
from rbpf_svgp_slam.run.aside import written_aside
from rbpf_svgp_slam.run.run_files import engine_predictor, load_terrain
from rbpf_svgp_slam.run.survey_run import GridMap, StoredMap, SurveyRun
from rbpf_svgp_slam.run.tracks import write_tum
from rbpf_svgp_slam.srv import GetMapsRequest
from rbpf_svgp_slam.survey_area.grid import cell_centres, grid_points
from rbpf_svgp_slam.survey_area.polygon import inside, survey_origin


def assemble_run(
    recording: Recording, bag: str, pings_lost: int = 0, is_over: bool = True
) -> SurveyRun:
    """Fetch the survey and the best particle's map, and evaluate the map on its grid.

    bag: empty for a live run; pings_lost: of the bag's, as far as the recorder can tell; is_over:
    nothing changes any more.
    """
    status = recording.statuses[-1]
    # While the survey goes on, the particles may have been resampled since that status.
    epoch = status.epoch if is_over else GetMapsRequest.ANY_EPOCH
    parameters = recording.parameters
    survey = fetch_survey()
    _save_trajectories(recording.out_dir, survey)
    stored = StoredMap(
        parameters.map.engine,
        fetch_map(status.best_particle, epoch, parameters.particles, parameters.nodes),
        survey_origin(parameters.survey_area),
    )
    engine = load_map(stored.engine, stored.state)
    predict = engine_predictor(engine, stored.origin_m)
    run = SurveyRun(
        stamp_s=survey.stamp_s,
        estimate=survey.estimate,
        estimate_covariance=survey.estimate_covariance,
        online=survey.online,
        online_covariance=survey.online_covariance,
        closures=fetch_closures(),
        fixes=fetch_fixes(),
        dead_reckoning=survey.dead_reckoning,
        ground_truth=recording.ground_truth.at(survey.stamp_s),
        levelled=survey.levelled,
        ping_of_beam=survey.ping_of_beam,
        held_out=survey.held_out,
        map=_grid(parameters.survey_area, parameters.map.resolution_m, predict),
        predict=predict,
        noise_variance_m2=engine.noise_variance_m2,
        support_points=engine.support_points() + np.append(stored.origin_m, 0.0),
        support_label=engine.support_label,
        stored_map=stored,
        terrain=load_terrain(recording.terrain_file) if recording.terrain_file else None,
        statistics=_statistics(recording, survey, pings_lost),
        status_history=recording.history.series(),
        time_lapse=recording.time_lapse.frames(),
        config=recording.parameter_tree,
    )
    run.statistics["provenance"] = provenance(bag, survey.stamp_s, is_over)
    run.statistics["sampled_map_rmse_m"] = sampled_map_rmse(run, status, epoch)
    return run


def _save_trajectories(out_dir: Path, survey: Any) -> None:
    """At once: a map that cannot be had must not cost the survey."""
    with written_aside(out_dir) as aside:
        write_tum(aside / "trajectory.tum", survey.stamp_s, survey.estimate)
        write_tum(aside / "online.tum", survey.stamp_s, survey.online)
        write_tum(aside / "dead_reckoning.tum", survey.stamp_s, survey.dead_reckoning)


def _grid(area: Polygon, resolution_m: float, predict: Any) -> GridMap:
    """Mean and variance over the survey area; NaN outside."""
    x, y = cell_centres(area, resolution_m)
    points = grid_points(x, y)
    within = inside(points, np.asarray(area, dtype=float))
    mean, variance = np.full((2, len(points)), np.nan)
    mean[within], variance[within] = predict_in_chunks(predict, points[within])
    return GridMap(x, y, mean.reshape(len(x), len(y)), variance.reshape(len(x), len(y)))


def _statistics(recording: Recording, survey: Any, pings_lost: int) -> dict[str, Any]:
    status = recording.statuses[-1]
    peaks_mb = [m.peak_rss_mb for m in recording.map_statuses.values()] + [status.peak_rss_mb]
    found = health(recording, pings_lost)
    if found["pings_dropped"]:
        rospy.logwarn("%d pings were lost on the way in.", found["pings_dropped"])
    return {
        "particles": status.particles,
        "nodes": status.nodes,
        "seed": recording.parameters.seed,
        "terrain": recording.terrain_file or None,
        "pings": int(status.pings),
        "pings_dropped": found["pings_dropped"],
        "beams": len(survey.levelled),
        "duration_s": float(survey.stamp_s[-1] - survey.stamp_s[0]) if len(survey.stamp_s) else 0.0,
        "wall_s": recording.wall_s,
        "iterations_total": sum(int(m.steps) for m in recording.map_lives.values()),
        "loop_closure_prompts": status.prompts,
        "resamplings": status.epoch,
        "founders": status.founders,
        "smoothing_s": status.smoothing_s,
        "maps_moved": status.maps_moved,
        "bytes_moved": int(status.bytes_moved),
        "prompt_s_median": _median(recording.statuses, "prompt_s", "prompts"),
        "resampling_s_median": _median(recording.statuses, "resampling_s", "epoch"),
        "ping_age_p99_s": status.ping_age_p99_s,
        "ping_age_max_s": status.ping_age_max_s,
        "peak_rss_mb": sum(peaks_mb),
        "refused": refusals(recording.statuses),
        "findings": list(status.findings),
        "velocity_source": status.velocity_source,
        "odometry_gaps": int(status.odometry_gaps),
        "fixes": int(status.fixes),
        "ground_truth_refused": dict(recording.ground_truth.refused),
        "health": found,
    }


def _median(statuses: list[FilterStatus], field: str, count: str) -> float:
    """Of what a status says of the latest of something that it counts; NaN if there was none."""
    values = {getattr(status, count): getattr(status, field) for status in statuses}
    return float(np.median([values[n] for n in values if n > 0] or [np.nan]))
