"""The errors that a survey's odometry and overlaps allow, to be held beside those of a run."""

from __future__ import annotations

from typing import Any

import numpy as np

from rbpf_svgp_slam.metrics.metric_names import IDEAL_METRICS
from rbpf_svgp_slam.metrics.trajectory_errors import ate_aligned_rmse, ate_rmse
from rbpf_svgp_slam.run.survey_run import SurveyRun
from rbpf_svgp_slam.smoothing.ideal import ideal
from rbpf_svgp_slam.smoothing.smoothing_parameters import smoothing_params

#: The errors of true relative poses are drawn so often.
DRAWS = 5


def ideal_metrics(run: SurveyRun, notes: list[str]) -> dict[str, Any]:
    """Return the report's errors of the ideal smoother and the ideal filter.

    Of each, the root mean square over several draws of the relative poses' errors: one draw may be
    a lucky one. None without ground truth or beams, and where the run's parameters are no
    smoother's.
    """
    nothing: dict[str, Any] = dict.fromkeys(IDEAL_METRICS)
    try:
        params = smoothing_params(run.config)
    except ValueError as error:
        notes.append(f"parameters.yaml: {error}: the errors of an ideal smoother are unknown")
        return nothing
    draws = []
    for seed in range(DRAWS):
        tracks = ideal(run, params, seed)
        if tracks is None:
            return nothing
        draws.append(
            {
                "ideal_ate_rmse_m": ate_rmse(tracks.smoothed, tracks.truth),
                "ideal_ate_aligned_rmse_m": ate_aligned_rmse(tracks.smoothed, tracks.truth),
                "ideal_online_ate_rmse_m": ate_rmse(tracks.online, tracks.truth),
            }
        )
    return {name: _rms([one[name] for one in draws]) for name in nothing}


def _rms(errors_m: list[float | None]) -> float | None:
    """None where an error is not defined, as after alignment of fewer than three poses."""
    if None in errors_m:
        return None
    return float(np.sqrt(np.mean(np.square(errors_m))))
