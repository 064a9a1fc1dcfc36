"""The look that all figures share, and helpers for drawing grids.

Colours are Okabe and Ito's, which colour-blind readers can tell apart.
"""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure

from .survey_run import SurveyRun

STYLE = {
    "figure.dpi": 130,
    "figure.constrained_layout.use": True,
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "axes.labelsize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.xmargin": 0.01,
    "grid.color": "#e2e5e9",
    "grid.linewidth": 0.6,
    "legend.frameon": True,
    "legend.framealpha": 0.9,
    "legend.edgecolor": "none",
    "legend.fontsize": 8,
    "lines.linewidth": 1.4,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
}
WIDTH_IN = 9.0
LEGEND_ABOVE = {"loc": "lower right", "bbox_to_anchor": (1, 1), "borderaxespad": 0.1, "ncol": 3}

LABELS = {"dead_reckoning": "dead reckoning", "estimate": "RBPF", "ground_truth": "ground truth"}
COLOURS = {"dead_reckoning": "#D55E00", "estimate": "#0072B2", "ground_truth": "#000000"}
DEPTH_MAP, SPREAD_MAP, DIFFERENCE_MAP, ERROR_MAP = "viridis", "cividis", "PuOr", "viridis"
DEPTH_LABEL = "z (m)"

_MAX_CELLS = 1000  # along an axis; a finer grid than the picture's pixels is only slow


def minutes_since_start(run: SurveyRun, stamp_s: np.ndarray) -> np.ndarray:
    """Return stamps as minutes since the first ping."""
    return (np.asarray(stamp_s, dtype=float) - run.stamp_s[0]) / 60


def map_axes(axes: Axes, title: str) -> None:
    """Make axes a plan view in metres, x to the right and y up."""
    axes.set(xlabel="x (m)", ylabel="y (m)", title=title)
    axes.set_aspect("equal", adjustable="box")
    axes.grid(False)
    axes.locator_params(nbins=5)


def draw_grid(axes: Axes, x: np.ndarray, y: np.ndarray, z: np.ndarray, **style) -> QuadMesh:
    """Draw z [nx, ny] at cell centres x [nx], y [ny]; NaN cells stay blank."""
    i, j = (-(-n // _MAX_CELLS) for n in z.shape)
    grid = np.ma.masked_invalid(z[::i, ::j].T)
    return axes.pcolormesh(x[::i], y[::j], grid, shading="nearest", rasterized=True, **style)


def colour_bar(figure: Figure, mesh: QuadMesh, axes, label: str, location="right") -> None:
    """Add a slim colour bar beside or below the given axes."""
    slim = {"shrink": 0.85, "aspect": 28, "pad": 0.02}
    bar = figure.colorbar(mesh, ax=axes, label=label, location=location, **slim)
    bar.outline.set_visible(False)


def colour_limits(*arrays: np.ndarray, symmetric: bool = False) -> dict[str, float]:
    """Return vmin and vmax that fit all arrays but for their outermost percent."""
    values = np.concatenate([np.ravel(array) for array in arrays])
    values = values[np.isfinite(values)]
    if not values.size:
        return {"vmin": 0.0, "vmax": 1.0}
    low, high = np.percentile(values, [1, 99])
    if symmetric:
        high = max(abs(low), abs(high))
        low = -high
    return {"vmin": low, "vmax": high}


def plan_aspect(run: SurveyRun) -> float:
    """Return height over width of the map, kept within what a page can show."""
    width, height = np.ptp(run.map.x), np.ptp(run.map.y)
    return float(np.clip(height / width, 0.25, 1.6)) if width > 0 else 1.0
