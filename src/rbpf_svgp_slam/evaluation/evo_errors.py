"""The trajectories' errors as evo computes them, as a check on ours.

evo (Grupp, "evo: Python package for the evaluation of odometry and SLAM") is what most of the
field scores trajectories with. Only evo.core is used, which needs nothing but numpy and scipy.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from .survey_run import SurveyRun
from .trajectory import rpe_frames


def evo_errors(run: SurveyRun, rpe_delta_s: float) -> dict[str, Any]:
    """Return evo's version, and its value in m of each error of report.json that it has.

    ATE without alignment, and RPE over all pairs of pings rpe_delta_s apart; an error that cannot
    be known is left out. Raises ImportError where evo is not installed.
    """
    import evo
    from evo.core import metrics

    errors: dict[str, Any] = {"version": evo.__version__.lstrip("v")}
    frames = rpe_frames(run.stamp_s, rpe_delta_s)
    for prefix, poses in (("", run.estimate), ("dr_", run.dead_reckoning)):
        ate = _rmse(metrics.APE(metrics.PoseRelation.translation_part), run, poses)
        rpe = None
        if frames is not None and frames < len(poses):
            unit = metrics.Unit.frames
            relation = metrics.PoseRelation.translation_part
            rpe = _rmse(metrics.RPE(relation, frames, unit, all_pairs=True), run, poses)
        errors[f"{prefix}ate_rmse_m"], errors[f"{prefix}rpe_rmse_m"] = ate, rpe
    return {name: value for name, value in errors.items() if value is not None}


def _rmse(metric: Any, run: SurveyRun, poses: np.ndarray) -> float | None:
    """What a metric of evo's says of poses [P, 6] where they and their truth are known."""
    from evo.core import metrics

    truth = run.ground_truth
    if truth is None:
        return None
    known = np.isfinite(poses).all(axis=1) & np.isfinite(truth).all(axis=1)
    if not known.any():
        return None
    metric.process_data((_evo_trajectory(run, truth, known), _evo_trajectory(run, poses, known)))
    # evo takes whole trajectories only, so that unknown poses were filled in; what rests on these
    # goes. The errors are one per pose, or one per pair, which ends at delta_ids.
    valid = known
    if isinstance(metric, metrics.RPE):
        valid = known[np.array(metric.delta_ids) - metric.delta] & known[metric.delta_ids]
    metric.error = metric.error[valid]
    return metric.get_statistic(metrics.StatisticsType.rmse) if len(metric.error) else None


def _evo_trajectory(run: SurveyRun, poses: np.ndarray, known: np.ndarray) -> Any:
    """poses [P, 6] as evo has them, the origin's where they are not known, [P]."""
    from evo.core.trajectory import PoseTrajectory3D

    poses = np.where(known[:, None], poses, 0.0)
    x, y, z, w = Rotation.from_euler("xyz", poses[:, 3:]).as_quat().T
    return PoseTrajectory3D(poses[:, :3], np.column_stack([w, x, y, z]), run.stamp_s)
