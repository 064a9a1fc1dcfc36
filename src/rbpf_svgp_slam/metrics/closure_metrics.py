"""Loop closures against ground truth: how many are wrong, and whether they know their errors."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np

from rbpf_svgp_slam.metrics.metric_names import CLOSURE_METRICS
from rbpf_svgp_slam.metrics.normalised_errors import normalised_squares, symmetric
from rbpf_svgp_slam.run.closures import Closures
from rbpf_svgp_slam.run.planar_poses import relative_pose, wrapped
from rbpf_svgp_slam.run.tracks import interpolate_poses

#: Quantile of χ² with 3 degrees of freedom that 99.73 % lie below, as within 3 σ of a Gaussian.
WRONG_ABOVE = 14.16
#: Between two pings that a closure's stamp lies between: a longer gap is not bridged.
GAP_S = 5.0


def closure_errors(
    closures: Closures, stamp_s: np.ndarray, track: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the errors [C, 3] of the relative poses against a track's, and eᵀ S⁻¹ e [C].

    track: poses [P, 6] at stamps [P]: the ground truth, or an estimate, whose residuals they then
    are. NaN where the track is not known at both stamps, and eᵀ S⁻¹ e also where a closure's
    covariance is not positive definite.
    """
    known = np.isfinite(track).all(axis=1)
    younger, older = (
        interpolate_poses(stamp_s[known], track[known], stamp, GAP_S)[:, [0, 1, 5]]
        for stamp in (closures.stamp, closures.stamp_older)
    )
    error = closures.relative - relative_pose(older, younger)
    error[:, 2] = wrapped(error[:, 2])
    return error, normalised_squares(error, symmetric(closures.covariance))


def closure_metrics(
    closures: Closures | None, stamp_s: np.ndarray, truth: np.ndarray, notes: list[str]
) -> dict[str, Any]:
    """Return the report's numbers about closures; None where they are not known.

    truth: poses [P, 6] at the pings' stamps [P], NaN where not known. An accepted closure is wrong
    if its error is beyond 3 of its own σ, all of x, y, yaw together. closure_nees is the median of
    eᵀ S⁻¹ e / 3: 0.79 where their covariances are right.
    """
    metrics: dict[str, Any] = {
        **dict.fromkeys(CLOSURE_METRICS),
        "closures": None,
        "closures_refused": None,
    }
    if closures is None:
        return metrics
    accepted = closures.accepted
    metrics["closures"] = closures.rows()
    metrics["closures_accepted"] = int(accepted.sum())
    metrics["closures_refused"] = dict(Counter(closures.verdict[~accepted].tolist()))
    if not np.isfinite(truth).all(axis=1).any():
        return metrics
    error, squares = (values[accepted] for values in closure_errors(closures, stamp_s, truth))
    judged, known = np.isfinite(squares), np.isfinite(error).all(axis=1)
    if not judged.all():
        notes.append(
            f"{(~judged).sum()} of {len(judged)} accepted closures cannot be judged: no ground "
            "truth at their stamps, or no covariance that is positive definite"
        )
    metrics["closures_wrong"] = int((squares[judged] > WRONG_ABOVE).sum())
    if judged.any():
        metrics["closures_wrong_share"] = metrics["closures_wrong"] / int(judged.sum())
        metrics["closure_nees"] = np.median(squares[judged]) / 3
    if known.any():
        metrics["closure_error_median_m"] = np.median(np.hypot(*error[known, :2].T))
    return metrics
