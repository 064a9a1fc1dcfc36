"""Poses x, y, yaw in the horizontal plane, [n, 3], m and rad."""

from __future__ import annotations

import numpy as np


def wrapped(angle_rad: np.ndarray) -> np.ndarray:
    """Return angles in [−π, π)."""
    return (angle_rad + np.pi) % (2 * np.pi) - np.pi


def relative_pose(older: np.ndarray, younger: np.ndarray) -> np.ndarray:
    """Return the younger poses in the frames of the older ones."""
    (dx, dy, dyaw), yaw = (younger - older).T, older[:, 2]
    forward = np.cos(yaw) * dx + np.sin(yaw) * dy
    left = -np.sin(yaw) * dx + np.cos(yaw) * dy
    return np.column_stack([forward, left, wrapped(dyaw)])
