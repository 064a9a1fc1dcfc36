"""Sound through layered water: where a beam ends, by its angle and its travel time.

Snell: sin(angle) / speed is the same all along a ray. Between a profile's points the water is cut
into layers of constant speed, thin enough for that not to matter.
"""

from __future__ import annotations

import numpy as np

from rbpf_svgp_slam.importers.sonar_recording import SoundSpeedProfile

#: Of a layer. At the steepest natural gradients, 1 (m/s)/m, and 60° from nadir, layers of so much
#: move a beam at 10 m by less than a millimetre.
LAYER_M = 0.5
#: But no more of them than this, in deep water.
MOST_LAYERS = 2000


def bent(
    angle_rad: np.ndarray,
    time_s: np.ndarray,
    surface_speed_mps: float,
    depth_m: float,
    profile: SoundSpeedProfile,
) -> np.ndarray:
    """Across and down [B, 2] from an array at a depth, m; NaN for a ray that would turn upwards.

    angle_rad [B]: from nadir, in the water at the array, which has the speed surface_speed_mps;
    time_s [B]: one way.
    """
    finite = np.isfinite(time_s) & np.isfinite(angle_rad)
    if not finite.any():
        return np.full((len(time_s), 2), np.nan)
    reach_m = 1.05 * profile.speed_mps.max() * time_s[finite].max()
    edges_m, speed_mps = _layers(profile, depth_m, reach_m)
    # a ray's parameter p = sin(angle) / speed; in a layer its angle's sine is p * speed
    sine = np.sin(angle_rad)[:, None] / surface_speed_mps * speed_mps
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine = np.sqrt(1 - np.where(np.abs(sine) < 1, sine, np.nan) ** 2)
    through_s = np.diff(edges_m) / (speed_mps * cosine)
    left_s = np.clip(
        time_s[:, None] - np.cumsum(through_s, axis=1) + through_s, 0.0, through_s
    )  # how long the ray is in each layer
    # beyond the layer that it ends in, a turned ray does not matter
    left_s = np.where(np.isnan(left_s) & _has_ended(through_s, time_s), 0.0, left_s)
    path_m = left_s * speed_mps
    across = np.sum(np.where(left_s == 0, 0.0, path_m * sine), axis=1)
    down = np.sum(np.where(left_s == 0, 0.0, path_m * cosine), axis=1)
    ends = np.stack([across, down], axis=-1)
    ends[~finite] = np.nan
    return ends


def _has_ended(through_s: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    """Whether a ray ends before a layer [B, L]."""
    before_s = np.cumsum(np.nan_to_num(through_s), axis=1) - np.nan_to_num(through_s)
    return before_s >= time_s[:, None]


def _layers(
    profile: SoundSpeedProfile, depth_m: float, reach_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """Edges [L + 1], m below the array, and the speed in each layer [L]."""
    inner_m = profile.depth_m - depth_m
    inner_m = inner_m[(inner_m > 0) & (inner_m < reach_m)]
    count = int(np.clip(np.ceil(reach_m / LAYER_M), 2, MOST_LAYERS))
    edges_m = np.unique(np.concatenate([np.linspace(0.0, reach_m, count + 1), inner_m]))
    middle_m = 0.5 * (edges_m[1:] + edges_m[:-1])
    return edges_m, np.interp(middle_m + depth_m, profile.depth_m, profile.speed_mps)
