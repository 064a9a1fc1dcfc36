"""Which depths have a contour."""

from __future__ import annotations

import math

import numpy as np

# Contours over the chart's range, at most.
_MOST_CONTOURS = 20


def contour_interval_m(elevation: np.ndarray) -> float:
    """1, 2 or 5 times a power of ten: the least that gives no more than 20 contours."""
    range_m = float(np.nanmax(elevation) - np.nanmin(elevation))
    wanted = max(range_m / _MOST_CONTOURS, 1e-3)
    power = 10.0 ** math.floor(math.log10(wanted))
    # Rounded, since log10 and powers of ten are not exact.
    return next(
        float(f"{factor * power:.6g}") for factor in (1, 2, 5, 10) if factor * power >= wanted
    )
