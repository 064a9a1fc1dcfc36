"""Smooths the past of a survey that is over, from its dead reckoning, beams and fixes alone."""

from __future__ import annotations

import dataclasses
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from rbpf_svgp_slam import _smoothing
from rbpf_svgp_slam.run.closures import Closures
from rbpf_svgp_slam.run.fixes import Fixes
from rbpf_svgp_slam.run.survey_run import SurveyRun
from rbpf_svgp_slam.run.tracks import interpolate_poses

PLANAR = [0, 1, 5]  # x, y, yaw of a pose
_UPPER = np.triu_indices(3)


@dataclass(frozen=True)
class Smoothed:
    """P pings and C closures."""

    poses: np.ndarray  # [P, 3] x, y, yaw, map frame, m and rad
    covariance: np.ndarray  # [P, 6]: xx, xy, x yaw, yy, y yaw, yaw yaw
    closures: Closures
    cpu_s: float


def smooth(
    stamp_s: np.ndarray,
    dead_reckoning: np.ndarray,
    levelled: np.ndarray,
    beams_per_ping: np.ndarray,
    params: _smoothing.SmoothingParams,
    fixes: Fixes | None = None,
) -> Smoothed:
    """Register windows of pings to older passes, twice, and solve the pose graph.

    stamp_s [P]; dead_reckoning [P, 3] x, y, yaw (m, rad), which starts where the track does;
    levelled [N, 3] m, finite: x forward, y left, z in map; beams_per_ping [P], adding up to N;
    fixes: with dead reckoning at each.
    """
    started_s = time.process_time()
    smoother = _smoothing.Smoother(params, stamp_s[0], dead_reckoning[0])
    smoother.add_pings(stamp_s, dead_reckoning, levelled.astype(np.float32), beams_per_ping)
    smoother.finish_pings()
    for fix in fixes.rows() if fixes else []:
        _add(fix, smoother)
    smoother.update()
    # Windows that lay on bent tracks, and where they were expected, are better known by now.
    smoother.register_again()
    return Smoothed(
        poses=smoother.poses,
        covariance=smoother.covariances[:, _UPPER[0], _UPPER[1]],
        closures=_closures(smoother.closures),
        cpu_s=time.process_time() - started_s,
    )


def _add(fix: dict[str, Any], smoother: _smoothing.Smoother) -> None:
    covariance = fix["covariance"][[[0, 1], [1, 2]]]
    heading = (fix["yaw"], fix["yaw_variance"]) if np.isfinite(fix["yaw"]) else None
    smoother.add_fix(fix["stamp"], fix["position"], covariance, fix["dead_reckoning"], heading)


def smooth_run(run: SurveyRun, params: _smoothing.SmoothingParams) -> tuple[SurveyRun, float]:
    """Return the run with its track, covariances and closures replaced; and the processor time, s.

    Pings without dead reckoning have no pose then. Height, roll and pitch are dead reckoning's,
    since they are measured. Raises ValueError where there is nothing to smooth.
    """
    known = np.isfinite(run.dead_reckoning).all(axis=1)
    if known.sum() < 2:
        raise ValueError(
            f"dead_reckoning.tum has poses at the stamps of {known.sum()} of {len(known)} pings; "
            "expected two at least"
        )
    good = known[run.ping_of_beam] & np.isfinite(run.levelled).all(axis=1)
    smoothed = smooth(
        run.stamp_s[known],
        run.dead_reckoning[known][:, PLANAR],
        run.levelled[good],
        np.bincount(run.ping_of_beam[good], minlength=len(known))[known],
        params,
        _located(run.fixes, run) if run.fixes else None,
    )
    estimate = run.dead_reckoning.copy()
    estimate[np.ix_(known, PLANAR)] = smoothed.poses
    covariance = np.full((len(known), 6), np.nan)
    covariance[known] = smoothed.covariance
    run = dataclasses.replace(
        run, estimate=estimate, estimate_covariance=covariance, closures=smoothed.closures
    )
    return run, smoothed.cpu_s


def _located(fixes: Fixes, run: SurveyRun) -> Fixes:
    """With dead reckoning at each, and in their order, since a late one may end the track.

    Raises ValueError that names a fix which is not as expected.
    """
    interpolated = interpolate_poses(run.stamp_s, run.dead_reckoning, fixes.stamp)[:, PLANAR]
    known = np.isfinite(fixes.dead_reckoning).all(axis=1)
    reckoned = np.where(known[:, None], fixes.dead_reckoning, interpolated)
    for number, fix in enumerate(fixes.rows()):
        a, b, c = fix["covariance"]
        if not (np.isfinite([*fix["position"], fix["stamp"]]).all() and a > 0 and a * c > b * b):
            raise ValueError(
                f"fixes.npz: fix {number} lies at {fix['position'].tolist()} m, with covariance "
                f"{[a, b, c]} m²; expected finite numbers, and a positive definite covariance"
            )
        if not np.isfinite(reckoned[number]).all():
            raise ValueError(
                f"fixes.npz: fix {number} is of {fix['stamp']:.3f} s, where dead_reckoning.tum has "
                "no pose; expected one there, or in the array dead_reckoning"
            )
    in_order = np.argsort(fixes.stamp, kind="stable")
    located = dataclasses.replace(fixes, dead_reckoning=reckoned)
    return Fixes(**{name: getattr(located, name)[in_order] for name in Fixes.names()})


def _closures(found: list[dict]) -> Closures:
    """What the smoother tells of its closures, in the columns that a run folder has."""

    def column(name: str, *shape: int) -> np.ndarray:
        return np.array([one[name] for one in found], dtype=float).reshape(-1, *shape)

    return Closures(
        stamp=column("stamp"),
        stamp_older=column("stamp_older"),
        relative=column("relative", 3),
        covariance=column("covariance", 3, 3)[:, _UPPER[0], _UPPER[1]],
        shift=column("shift", 3),
        rms_m=column("rms_m"),
        beams=column("beams").astype(int),
        weight=column("weight"),
        verdict=np.array([one["verdict"] for one in found], dtype=str),
    )
