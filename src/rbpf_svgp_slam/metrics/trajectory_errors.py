"""Errors of trajectories against ground truth.

Poses as in run/tracks.py.
"""

from __future__ import annotations

import warnings

import numpy as np
from scipy.spatial.transform import Rotation

from rbpf_svgp_slam.run.tracks import rotations


def position_error(poses: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Return the position errors [P, 3] in m, without alignment; NaN where truth is unknown."""
    return poses[:, :3] - truth[:, :3]


def ate_rmse(poses: np.ndarray, truth: np.ndarray) -> float | None:
    """Absolute trajectory error in m: the RMS of the 3-D position error; None without truth.

    There is no alignment, unlike in Sturm et al. (2012): the start pose is known.
    """
    squared = np.sum(position_error(poses, truth) ** 2, axis=1)
    known = np.isfinite(squared)
    return float(np.sqrt(squared[known].mean())) if known.any() else None


def ate_aligned_rmse(poses: np.ndarray, truth: np.ndarray) -> float | None:
    """Return the ATE in m after the rigid motion that makes it least, as Sturm et al. (2012).

    What remains is the error of the track's shape: that of a map that lies askew in the map frame,
    though right in itself, is nothing. None with fewer than three poses whose truth is known.
    """
    known = np.isfinite(position_error(poses, truth)).all(axis=1)
    if known.sum() < 3:
        return None
    centred, target = (track[known, :3] - track[known, :3].mean(axis=0) for track in (poses, truth))
    # The rotation of Horn (1987) and Umeyama (1991). About a straight track it is not unique, of
    # which scipy warns; the error is.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        rotation, _ = Rotation.align_vectors(target, centred)
    squared = np.sum((rotation.apply(centred) - target) ** 2, axis=1)
    return float(np.sqrt(squared.mean()))


def final_error(poses: np.ndarray, truth: np.ndarray) -> float | None:
    """Return the 3-D position error in m at the last pose whose truth is known, else None."""
    distance = np.linalg.norm(position_error(poses, truth), axis=1)
    known = np.flatnonzero(np.isfinite(distance))
    return float(distance[known[-1]]) if known.size else None


def rpe_frames(stamp_s: np.ndarray, delta_s: float) -> int | None:
    """Return how many pings make up delta_s, at least 1, by the median period of stamp_s [P].

    None where that is unknown: fewer than two pings, or stamps that do not increase.
    """
    period_s = np.median(np.diff(stamp_s)) if len(stamp_s) > 1 else 0.0
    return max(1, round(delta_s / period_s)) if period_s > 0 else None


def rpe_rmse(poses: np.ndarray, truth: np.ndarray, frames: int | None) -> float | None:
    """Relative pose error in m of poses [P, 6] against truth [P, 6]: drift over `frames` pings.

    Sturm et al. (2012): the RMS of the translations of (Q_i⁻¹ Q_{i+n})⁻¹ (P_i⁻¹ P_{i+n}), with P
    the poses, Q the truth and n = frames, over all i whose four poses are known (no NaN). None
    where there is no such i, or where frames is None.
    """
    if frames is None:
        return None
    known = np.isfinite(poses).all(axis=1) & np.isfinite(truth).all(axis=1)
    first = np.flatnonzero(known[:-frames] & known[frames:])
    if not first.size:
        return None
    # The error's translation is R_Qᵀ (t_P − t_Q), R_Q the rotation of the true motion, which does
    # not change its length.
    error = _motion(poses, first, frames) - _motion(truth, first, frames)
    return float(np.sqrt(np.mean(np.sum(error**2, axis=1))))


def _motion(poses: np.ndarray, first: np.ndarray, frames: int) -> np.ndarray:
    """Translations [n, 3] in m of P_i⁻¹ P_{i+frames}, seen from pose i, for i in first [n]."""
    step = poses[first + frames, :3] - poses[first, :3]
    return rotations(poses[first]).inv().apply(step)
