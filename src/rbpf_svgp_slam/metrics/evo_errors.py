"""The trajectories' errors as evo computes them, as a check on ours.

evo (Grupp, "evo: Python package for the evaluation of odometry and SLAM") is what most of the
field scores trajectories with. Only evo.core is used, which needs nothing but numpy and scipy.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from rbpf_svgp_slam.metrics.trajectory_errors import rpe_frames
from rbpf_svgp_slam.run.survey_run import SurveyRun


def evo_errors(run: SurveyRun, rpe_delta_s: float) -> dict[str, Any]:
    """Return evo's version, and its value in m of each error of report.json that it has.

    ATE without alignment and with it, and RPE over all pairs of pings rpe_delta_s apart; an error
    that cannot be known is left out. Raises ImportError where evo is not installed.
    """
    import evo
    from evo.core import metrics

    errors: dict[str, Any] = {"version": evo.__version__.lstrip("v")}
    frames = rpe_frames(run.stamp_s, rpe_delta_s)
    tracks = {"": run.estimate, "dr_": run.dead_reckoning, "online_": run.online}
    for prefix, poses in tracks.items():
        if poses is None:
            continue
        ate = _rmse(metrics.APE(metrics.PoseRelation.translation_part), run, poses)
        rpe = None
        # The online estimate's steps at resamplings are no drift: it has no RPE.
        if prefix != "online_" and frames is not None and frames < len(poses):
            unit = metrics.Unit.frames
            relation = metrics.PoseRelation.translation_part
            rpe = _rmse(metrics.RPE(relation, frames, unit, all_pairs=True), run, poses)
        errors[f"{prefix}ate_rmse_m"], errors[f"{prefix}rpe_rmse_m"] = ate, rpe
        errors[f"{prefix}ate_aligned_rmse_m"] = _aligned_ate(run, poses)
    return {name: value for name, value in errors.items() if value is not None}


def _rmse(metric: Any, run: SurveyRun, poses: np.ndarray) -> float | None:
    """What a metric of evo's says of poses [P, 6] where they and their truth are known."""
    from evo.core import metrics

    known = _known(run, poses)
    if not known.any():
        return None
    pair = (_evo_trajectory(run, track, known) for track in (run.ground_truth, poses))
    metric.process_data(tuple(pair))
    # evo takes whole trajectories only, so that unknown poses were filled in; what rests on these
    # goes. The errors are one per pose, or one per pair, which ends at delta_ids.
    valid = known
    if isinstance(metric, metrics.RPE):
        valid = known[np.array(metric.delta_ids) - metric.delta] & known[metric.delta_ids]
    metric.error = metric.error[valid]
    return metric.get_statistic(metrics.StatisticsType.rmse) if len(metric.error) else None


def _aligned_ate(run: SurveyRun, poses: np.ndarray) -> float | None:
    """The ATE in m of poses [P, 6] after Umeyama's alignment; None where evo finds none."""
    from evo.core import metrics
    from evo.core.geometry import GeometryException

    known = _known(run, poses)
    if not known.any():
        return None
    truth, track = (_evo_trajectory(run, each, known) for each in (run.ground_truth, poses))
    for each in (truth, track):
        each.reduce_to_ids(np.flatnonzero(known))
    try:
        track.align(truth)
    except GeometryException:  # of a straight track
        return None
    metric = metrics.APE(metrics.PoseRelation.translation_part)
    metric.process_data((truth, track))
    return metric.get_statistic(metrics.StatisticsType.rmse)


def _known(run: SurveyRun, poses: np.ndarray) -> np.ndarray:
    """[P] whether a pose of poses [P, 6] and its truth are known."""
    if run.ground_truth is None:
        return np.zeros(len(poses), dtype=bool)
    return np.isfinite(poses).all(axis=1) & np.isfinite(run.ground_truth).all(axis=1)


def _evo_trajectory(run: SurveyRun, poses: np.ndarray, known: np.ndarray) -> Any:
    """poses [P, 6] as evo has them, the origin's where they are not known, [P]."""
    from evo.core.trajectory import PoseTrajectory3D

    poses = np.where(known[:, None], poses, 0.0)
    x, y, z, w = Rotation.from_euler("xyz", poses[:, 3:]).as_quat().T
    return PoseTrajectory3D(poses[:, :3], np.column_stack([w, x, y, z]), run.stamp_s)
