"""Square cells of the map frame, named by one integer, so that far outliers cost no memory."""

from __future__ import annotations

import numpy as np

_COLUMN = 2**32  # step of the key from one cell to the next along x
_HALF = 2**31


def cell_keys(xy: np.ndarray, resolution_m: float) -> np.ndarray:
    """Return the key [n] of the cell that holds each point xy [n, 2] (finite, m, map frame)."""
    index = np.floor(np.asarray(xy, dtype=float) / resolution_m).astype(np.int64)
    return index[:, 0] * _COLUMN + index[:, 1] + _HALF


def cell_centres(keys: np.ndarray, resolution_m: float) -> np.ndarray:
    """Return the centres [n, 2] in m of the cells of the given keys [n]."""
    column, row = np.divmod(keys, _COLUMN)
    return (np.column_stack([column, row - _HALF]) + 0.5) * resolution_m


def neighbour_keys(keys: np.ndarray) -> np.ndarray:
    """Return the keys [n, 9] of the 3 × 3 cells around each cell [n]."""
    steps = [i * _COLUMN + j for i in (-1, 0, 1) for j in (-1, 0, 1)]
    return keys[:, None] + np.array(steps)


def cell_means(points: np.ndarray, resolution_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the keys [C], sorted, and mean z [C] in m of the filled cells of points [n, 3]."""
    keys, cell, count = np.unique(
        cell_keys(points[:, :2], resolution_m), return_inverse=True, return_counts=True
    )
    return keys, np.bincount(cell, weights=points[:, 2], minlength=len(keys)) / count
