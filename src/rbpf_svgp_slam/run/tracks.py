"""Pose tracks: TUM files and interpolation.

A pose is [x y z roll pitch yaw] in metres and radians, map frame, with REP 103's fixed-axis angles:
R = Rz(yaw) Ry(pitch) Rx(roll).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

#: A longer gap of the ground truth is not bridged: the pings in it have none.
GROUND_TRUTH_GAP_S = 5.0
_EULER = "xyz"  # lower case: rotations about fixed axes, roll first
_TUM_FIELDS = "stamp_s x y z qx qy qz qw"
_UNIT_TOLERANCE = 1e-3  # TUM files of other tools keep as few as four decimals


def write_tum(path: str | Path, stamp_s: np.ndarray, poses: np.ndarray) -> None:
    """Write poses [K, 6] at stamp_s [K]; rows that are not finite are left out."""
    known = np.isfinite(poses).all(axis=1)
    # scipy 1.10 refuses an empty set of rotations.
    quaternions = rotations(poses[known]).as_quat() if known.any() else np.empty((0, 4))
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
        result[covered, 3:] = Slerp(stamp_s, rotations(poses))(inside_s).as_euler(_EULER)
    return result


def rotations(poses: np.ndarray) -> Rotation:
    """The attitudes of poses [K, 6]."""
    return Rotation.from_euler(_EULER, poses[:, 3:])
