"""All metrics of a finished run, and the arrays behind its figures."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from rbpf_svgp_slam.metrics.closure_metrics import closure_metrics
from rbpf_svgp_slam.metrics.consistency import (
    Consistency,
    ConsistencySettings,
    consistency,
    split_passes,
)
from rbpf_svgp_slam.metrics.ideal_metrics import ideal_metrics
from rbpf_svgp_slam.metrics.map_metrics import (
    HeldOutScores,
    grid_on,
    predict_in_chunks,
    rmse,
    score_held_out,
    terrain_at,
)
from rbpf_svgp_slam.metrics.metric_names import SEABED_METRICS
from rbpf_svgp_slam.metrics.normalised_errors import nees
from rbpf_svgp_slam.metrics.survey_metrics import survey_metrics
from rbpf_svgp_slam.metrics.trajectory_errors import (
    ate_aligned_rmse,
    ate_rmse,
    final_error,
    rpe_frames,
    rpe_rmse,
)
from rbpf_svgp_slam.metrics.verdicts import verdicts
from rbpf_svgp_slam.run.survey_run import GridMap, Predict, SurveyRun

_COUNTERS = (
    "particles nodes seed pings pings_dropped beams duration_s wall_s "
    "iterations_total loop_closure_prompts resamplings founders smoothing_s peak_rss_mb"
).split()
_INTERVAL95_SIGMAS = 1.959964  # of a Gaussian, two-sided
_RPE_DELTA_S = 60.0  # long against the wander within one line, short against a survey


@dataclass
class Evaluation:
    """The report and the arrays behind its figures."""

    report: dict[str, Any]
    held_out: HeldOutScores | None  # of the best particle's map
    seabed_held_out: HeldOutScores | None
    consistencies: dict[str, Consistency]  # by trajectory, and of the map with the beams


def evaluate(run: SurveyRun, settings: ConsistencySettings = ConsistencySettings()) -> Evaluation:
    """Compute every metric of the run; what cannot be known is None, with a note that says why."""
    notes: list[str] = []
    held_out, seabed_held_out = _score_maps(run, notes)
    consistencies = _consistencies(run, settings, notes)
    report = {
        **run.statistics,
        **_place_on_earth(run),
        **_counters(run, notes),
        **_trajectory_metrics(run, notes),
        **ideal_metrics(run, notes),
        **_map_metrics(run, held_out, notes),
        **_seabed_metrics(run, seabed_held_out),
        **survey_metrics(run, notes),
        **_consistency_metrics(run, consistencies, settings),
        "notes": notes,
    }
    report = json_ready(report)
    report["verdicts"] = verdicts(report)
    return Evaluation(report, held_out, seabed_held_out, consistencies)


def json_ready(value: Any) -> Any:
    """Turn numpy types into plain ones, and numbers that are not finite into None."""
    if isinstance(value, dict):
        return {str(key): json_ready(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [json_ready(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _place_on_earth(run: SurveyRun) -> dict[str, Any]:
    """The parameters that tell it, if they are set."""
    names = ("survey_origin", "survey_epsg")
    return {name: run.config[name] for name in names if run.config.get(name)}


def _counters(run: SurveyRun, notes: list[str]) -> dict[str, Any]:
    known = {"pings": len(run.stamp_s), "beams": len(run.levelled), **run.statistics}
    if len(run.stamp_s):
        known.setdefault("duration_s", run.stamp_s[-1] - run.stamp_s[0])
    counters = {name: known.get(name) for name in _COUNTERS}
    missing = [name for name, value in counters.items() if value is None]
    if missing:
        notes.append(f"not recorded by the run: {', '.join(missing)}")
    iterations = counters["iterations_total"]
    return {
        **counters,
        "real_time_factor": _ratio(counters["duration_s"], counters["wall_s"]),
        "iterations_per_particle": _ratio(iterations, counters["particles"]),
        "iterations_per_s": _ratio(iterations, counters["wall_s"]),
    }


def _ratio(numerator: float | None, denominator: float | None) -> float | None:
    return numerator / denominator if numerator is not None and denominator else None


def _trajectory_metrics(run: SurveyRun, notes: list[str]) -> dict[str, Any]:
    truth = run.ground_truth
    if truth is None or not np.isfinite(truth[:, :3]).all(axis=1).any():
        notes.append("no ground truth: the errors of the trajectories are unknown")
        truth = np.full((len(run.stamp_s), 6), np.nan)
    known = np.isfinite(truth[:, :3]).all(axis=1)
    online = np.full_like(run.estimate, np.nan) if run.online is None else run.online
    if known.any() and not known.all():
        notes.append(
            f"ground truth covers {known.sum()} of {len(known)} pings; errors are on these"
        )
    ate = ate_rmse(run.estimate, truth)
    dr_ate = ate_rmse(run.dead_reckoning, truth)
    frames = rpe_frames(run.stamp_s, _RPE_DELTA_S)
    return {
        "ate_rmse_m": ate,
        "online_ate_rmse_m": ate_rmse(online, truth),
        "dr_ate_rmse_m": dr_ate,
        "ate_ratio": _ratio(ate, dr_ate),
        "ate_aligned_rmse_m": ate_aligned_rmse(run.estimate, truth),
        "online_ate_aligned_rmse_m": ate_aligned_rmse(online, truth),
        "dr_ate_aligned_rmse_m": ate_aligned_rmse(run.dead_reckoning, truth),
        "final_error_m": final_error(run.estimate, truth),
        "dr_final_error_m": final_error(run.dead_reckoning, truth),
        "rpe_rmse_m": rpe_rmse(run.estimate, truth, frames),
        "dr_rpe_rmse_m": rpe_rmse(run.dead_reckoning, truth, frames),
        "rpe_delta_s": _RPE_DELTA_S,
        **_nees("nees", run.estimate, run.estimate_covariance, truth),
        **_nees("online_nees", online, run.online_covariance, truth),
        **closure_metrics(run.closures, run.stamp_s, truth, notes),
    }


def _nees(
    name: str, poses: np.ndarray, covariance: np.ndarray | None, truth: np.ndarray
) -> dict[str, Any]:
    mean, skipped = (None, None) if covariance is None else nees(poses, covariance, truth)
    return {name: mean, f"{name}_skipped": skipped}


def _score_maps(
    run: SurveyRun, notes: list[str]
) -> tuple[HeldOutScores | None, HeldOutScores | None]:
    """Of the best particle's map and of the seabed."""
    is_held_out = run.held_out[run.ping_of_beam]
    finite = np.isfinite(run.beams).all(axis=1)
    if not finite.all():
        notes.append(f"{(~finite).sum()} beams are not finite and were left out")
    held_out, training = run.beams[is_held_out & finite], run.beams[~is_held_out & finite]
    if not len(held_out):
        notes.append("no held-out beams: the map's errors are unknown")

    def score(name: str, predict: Predict, noise_variance_m2: float) -> HeldOutScores | None:
        if not len(held_out):
            return None
        scores = score_held_out(predict, noise_variance_m2, held_out, training)
        if len(scores.residual_m):
            return scores
        notes.append(f"the {name} predicts no held-out beam: its errors are unknown")
        return None

    of_map = score("map", run.predict, run.noise_variance_m2)
    seabed = run.seabed_map
    if seabed is None:
        notes.append(f"no seabed of the final trajectory: {run.why_no_seabed}")
        return of_map, None
    if seabed.spacing_m > run.map.resolution_m:
        notes.append(
            f"the seabed is computed on nodes {seabed.spacing_m:g} m apart, coarser than the map's "
            f"{run.map.resolution_m:g} m: of those it would have too many"
        )
    return of_map, score("seabed", seabed.predict, seabed.noise_variance_m2)


def _map_metrics(run: SurveyRun, scores: HeldOutScores | None, notes: list[str]) -> dict[str, Any]:
    names = (
        "map_rmse_m map_msll map_coverage grid_rmse_m grid_coverage map_rmse_on_grid_beams_m "
        "interval95_coverage held_out_beams"
    ).split()
    metrics: dict[str, Any] = dict.fromkeys(names)
    metrics["map_rmse_at_ground_truth_m"] = _rmse_at_ground_truth(run)
    metrics["terrain_rmse_m"] = _terrain_rmse(run, run.map)
    metrics["noise_std_m"] = math.sqrt(run.noise_variance_m2)
    if scores is None:
        return metrics
    on_grid = scores.on_grid
    if not on_grid.any():
        notes.append("no held-out beam lies on or beside a filled cell: the grid says nothing")
    if scores.msll is None:
        notes.append("no spread of training beams to compare with: map_msll is unknown")
    return {
        **metrics,
        "map_rmse_m": rmse(scores.residual_m),
        "map_msll": scores.msll,
        "map_coverage": scores.coverage,
        "grid_rmse_m": rmse(scores.grid_residual_m[on_grid]),
        "grid_coverage": on_grid.mean(),
        "map_rmse_on_grid_beams_m": rmse(scores.residual_m[on_grid]),
        "interval95_coverage": _interval95_coverage(scores),
        "held_out_beams": len(scores.residual_m),
    }


def _seabed_metrics(run: SurveyRun, scores: HeldOutScores | None) -> dict[str, Any]:
    metrics: dict[str, Any] = dict.fromkeys(SEABED_METRICS)
    if run.seabed is not None:
        metrics["seabed_terrain_rmse_m"] = _terrain_rmse(run, run.seabed)
        metrics["seabed_noise_std_m"] = math.sqrt(run.seabed_map.noise_variance_m2)
        metrics["seabed_spacing_m"] = run.seabed_map.spacing_m
    if scores is not None:
        metrics["seabed_rmse_m"] = rmse(scores.residual_m)
        metrics["seabed_msll"] = scores.msll
        metrics["seabed_coverage"] = scores.coverage
        metrics["seabed_rmse_on_grid_beams_m"] = rmse(scores.residual_m[scores.on_grid])
        metrics["seabed_interval95_coverage"] = _interval95_coverage(scores)
    return metrics


def _interval95_coverage(scores: HeldOutScores) -> float:
    return float(np.mean(np.abs(scores.standardised) < _INTERVAL95_SIGMAS))


def _rmse_at_ground_truth(run: SurveyRun) -> float | None:
    """RMSE at the held-out beams placed where they really were: the map's error as a chart."""
    if run.beams_ground_truth is None:
        return None
    beams = run.beams_ground_truth[run.held_out[run.ping_of_beam]].astype(float)
    beams = beams[np.isfinite(beams).all(axis=1)]
    mean, _ = predict_in_chunks(run.predict, beams[:, :2])
    residual = beams[:, 2] - mean
    return rmse(residual[np.isfinite(residual)])


def _terrain_rmse(run: SurveyRun, grid: GridMap) -> float | None:
    """RMSE of the grid's mean against the true terrain over the cells that beams have hit."""
    if run.terrain is None:
        return None
    difference = grid.mean - terrain_at(run.terrain, grid)
    hit = np.isfinite(grid_on(grid, run.beams)) & np.isfinite(difference)
    return rmse(difference[hit])


def _consistencies(
    run: SurveyRun, settings: ConsistencySettings, notes: list[str]
) -> dict[str, Consistency]:
    # One split for all trajectories, so that they are compared over the same pairs of passes.
    passes = split_passes(run.dead_reckoning[:, 5])[run.ping_of_beam]
    placed = {
        "estimate": run.beams,
        "dead_reckoning": run.beams_dead_reckoning,
        "ground_truth": run.beams_ground_truth,
    }
    results = {
        name: consistency(beams, passes, settings, np.random.default_rng(settings.seed))
        for name, beams in placed.items()
        if beams is not None
    }
    results["map"] = _map_consistency(run, settings)
    if results["estimate"].rms_m is None:
        notes.append("no cell is seen by two passes: the survey's consistency is unknown")
    return results


def _map_consistency(run: SurveyRun, settings: ConsistencySettings) -> Consistency:
    """Of two clouds in place of the passes: the beams, and the map's mean at their positions.

    Both have the same horizontal positions, so that a map without error is at distance zero.
    """
    beams = run.beams[np.isfinite(run.beams).all(axis=1)]
    rng = np.random.default_rng(settings.seed)
    beams = rng.permutation(beams)[: settings.max_beams // 2]
    mean, _ = predict_in_chunks(run.predict, beams[:, :2])
    clouds = np.concatenate([beams, np.column_stack([beams[:, :2], mean])])
    return consistency(clouds, np.repeat([0, 1], len(beams)), settings, rng)


def _consistency_metrics(
    run: SurveyRun, results: dict[str, Consistency], settings: ConsistencySettings
) -> dict[str, Any]:
    truth = results.get("ground_truth")
    return {
        "consistency_rmse_m": results["estimate"].rms_m,
        "dr_consistency_rmse_m": results["dead_reckoning"].rms_m,
        "ground_truth_consistency_rmse_m": truth.rms_m if truth else None,
        "map_consistency_rmse_m": results["map"].rms_m,
        "overlap_consistency_rmse_m": results["estimate"].overlap_rms_m,
        "dr_overlap_consistency_rmse_m": results["dead_reckoning"].overlap_rms_m,
        "ground_truth_overlap_consistency_rmse_m": truth.overlap_rms_m if truth else None,
        "consistency": {
            **asdict(settings),
            "passes": len(np.unique(split_passes(run.dead_reckoning[:, 5]))),
            "overlap_cells": len(results["estimate"].error_m),
            "points_per_cell_and_pass": results["estimate"].points_per_cell_and_pass,
        },
    }
