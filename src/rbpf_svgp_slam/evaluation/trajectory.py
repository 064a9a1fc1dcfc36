"""Pose tracks: TUM files, interpolation, and errors against ground truth.

A pose is [x y z roll pitch yaw] in metres and radians, map frame, with REP 103's fixed-axis angles:
R = Rz(yaw) Ry(pitch) Rx(roll).
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

_EULER = "xyz"  # lower case: rotations about fixed axes, roll first
_TUM_FIELDS = "stamp_s x y z qx qy qz qw"
_UNIT_TOLERANCE = 1e-3  # TUM files of other tools keep as few as four decimals


def write_tum(path: str | Path, stamp_s: np.ndarray, poses: np.ndarray) -> None:
    """Write poses [K, 6] at stamp_s [K]; rows that are not finite are left out."""
    known = np.isfinite(poses).all(axis=1)
    # scipy 1.10 refuses an empty set of rotations.
    quaternions = _rotations(poses[known]).as_quat() if known.any() else np.empty((0, 4))
    rows = np.column_stack([stamp_s[known], poses[known, :3], quaternions])
    np.savetxt(path, rows, fmt="%.9f", header=_TUM_FIELDS)


def read_tum(path: str | Path) -> tuple[np.ndarray, np.ndarray]:
    """Return stamp_s [K] and poses [K, 6]; a malformed line raises with its number."""
    rows = []
    for number, line in enumerate(Path(path).read_text().splitlines(), start=1):
        text = line.split("#", 1)[0].split()
        if text:
            rows.append(_parse_tum_line(text, where=f"{path}:{number}"))
            if len(rows) > 1 and rows[-1][0] <= rows[-2][0]:
                raise ValueError(f"{path}:{number}: expected increasing stamps, got {text[0]}")
    table = np.array(rows).reshape(-1, 8)
    poses = np.zeros((len(table), 6))
    if len(table):
        angles = Rotation.from_quat(table[:, 4:]).as_euler(_EULER)
        poses = np.column_stack([table[:, 1:4], angles])
    return table[:, 0], poses


def _parse_tum_line(text: list[str], where: str) -> list[float]:
    if len(text) != 8:
        raise ValueError(f"{where}: expected 8 numbers ({_TUM_FIELDS}), got {len(text)}")
    try:
        row = [float(word) for word in text]
    except ValueError:
        raise ValueError(f"{where}: expected 8 numbers, got {' '.join(text)!r}") from None
    if not np.isfinite(row).all():
        raise ValueError(f"{where}: expected finite numbers, got {' '.join(text)!r}")
    norm = np.linalg.norm(row[4:])
    if abs(norm - 1) > _UNIT_TOLERANCE:
        raise ValueError(f"{where}: expected a unit quaternion, got one of norm {norm:.6g}")
    return row


def interpolate_poses(
    stamp_s: np.ndarray, poses: np.ndarray, query_s: np.ndarray, max_gap_s: float = np.inf
) -> np.ndarray:
    """Interpolate a track poses [K, 6] at stamp_s [K] to query_s [P], giving [P, 6].

    Positions linearly, attitudes along the shortest arc. NaN outside the track, and inside any
    gap longer than `max_gap_s`. Messages may come in any order; of equal stamps the first counts.
    """
    query_s = np.asarray(query_s, dtype=float)
    result = np.full((len(query_s), 6), np.nan)
    stamp_s, first = np.unique(np.asarray(stamp_s, dtype=float), return_index=True)
    poses = np.asarray(poses, dtype=float)[first]
    if not (np.isfinite(stamp_s).all() and np.isfinite(poses).all()):
        raise ValueError("poses: expected a finite track to interpolate")
    if len(stamp_s) < 2:
        return result
    right = np.clip(np.searchsorted(stamp_s, query_s), 1, len(stamp_s) - 1)
    covered = (query_s >= stamp_s[0]) & (query_s <= stamp_s[-1])
    covered &= (stamp_s[right] - stamp_s[right - 1] <= max_gap_s) | np.isin(query_s, stamp_s)
    inside_s = query_s[covered]
    for axis in range(3):
        result[covered, axis] = np.interp(inside_s, stamp_s, poses[:, axis])
    if covered.any():
        result[covered, 3:] = Slerp(stamp_s, _rotations(poses))(inside_s).as_euler(_EULER)
    return result


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
    return _rotations(poses[first]).inv().apply(step)


def _rotations(poses: np.ndarray) -> Rotation:
    return Rotation.from_euler(_EULER, poses[:, 3:])
