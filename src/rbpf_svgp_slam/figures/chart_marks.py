"""What a chart has beside its colours: contours, scale bar, north arrow, a note of its frame."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.contour import ContourSet
from matplotlib.lines import Line2D
from matplotlib.offsetbox import AnchoredOffsetbox, DrawingArea
from matplotlib.patches import Polygon
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.transforms import ScaledTranslation
from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar

from rbpf_svgp_slam.charts.contours import contour_interval_m

_INK = "#1c2733"
# Every fifth contour is an index contour, which is thicker and has its depth written on it.
_INDEX_STEP = 5
# Of a chart's width, at most.
_SCALE_BAR_SHARE = 0.25


def draw_contours(axes: Axes, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> float | None:
    """Draw contours of z [nx, ny], m, at cell centres x [nx], y [ny], with their depths written on
    index contours; returns their interval, m, or None where there are too few cells for any."""
    if min(z.shape) < 2 or not np.ptp(z[np.isfinite(z)]) > 0:
        return None
    interval_m = contour_interval_m(z)
    steps = np.arange(np.ceil(np.nanmin(z) / interval_m), np.floor(np.nanmax(z) / interval_m) + 1)
    index = steps[steps % _INDEX_STEP == 0]
    # Of few contours all are labelled.
    labelled = index if len(index) > 1 else steps
    surface = np.ma.masked_invalid(z.T)
    for some, width in ((np.setdiff1d(steps, labelled), 0.45), (labelled, 0.9)):
        if not len(some):
            continue
        look = {"colors": _INK, "alpha": 0.75, "linewidths": width, "linestyles": "solid"}
        look["corner_mask"] = False  # which would draw into cells that are masked
        drawn = axes.contour(x, y, surface, levels=some * interval_m, **look)
        if some is labelled:
            _label(axes, drawn)
    return interval_m


def _label(axes: Axes, contours: ContourSet) -> None:
    """Write the depths on contours of z, legible on any ground."""
    texts = axes.clabel(contours, fontsize=7, fmt=lambda z: f"{0.0 - z:.6g}", inline_spacing=2)
    for text in texts:
        text.set(alpha=1, path_effects=[withStroke(linewidth=1.8, foreground="white")])


def scale_bar_m(width_m: float) -> float:
    """Return the length of a scale bar: 1, 2 or 5 times a power of ten, a quarter at most of a
    chart's width."""
    most = max(width_m * _SCALE_BAR_SHARE, 1e-3)
    power = 10.0 ** np.floor(np.log10(most))
    return float(max(factor * power for factor in (1, 2, 5) if factor * power <= most))


def draw_scale_bar(axes: Axes) -> None:
    """Draw it under the right end of the x axis; after the axes have their limits."""
    left, right = axes.get_xlim()
    length_m = scale_bar_m(right - left)
    label = f"{length_m / 1000:g} km" if length_m >= 1000 else f"{length_m:g} m"
    below = ScaledTranslation(0, -0.24, axes.figure.dpi_scale_trans)
    bar = AnchoredSizeBar(
        axes.transData,
        length_m,
        label,
        loc="upper right",
        pad=0,
        borderpad=0,
        sep=3,
        frameon=False,
        size_vertical=(right - left) / 300,
        color=_INK,
        bbox_to_anchor=(1, 0),
        bbox_transform=axes.transAxes + below,
    )
    bar.set_clip_on(False)
    axes.add_artist(bar)


def draw_north_arrow(axes: Axes) -> None:
    """Draw it above the right end of the axes, whose y is north."""
    area = DrawingArea(12, 26)
    area.add_artist(Polygon([[6, 17], [0, 0], [6, 4]], facecolor=_INK, edgecolor=_INK, lw=0.6))
    area.add_artist(Polygon([[6, 17], [12, 0], [6, 4]], facecolor="white", edgecolor=_INK, lw=0.6))
    area.add_artist(Text(6, 19, "N", ha="center", fontsize=8, fontweight="bold", color=_INK))
    above = ScaledTranslation(0, 0.04, axes.figure.dpi_scale_trans)
    arrow = AnchoredOffsetbox(
        "lower right",
        child=area,
        pad=0,
        borderpad=0,
        frameon=False,
        bbox_to_anchor=(1, 1),
        bbox_transform=axes.transAxes + above,
    )
    arrow.set_clip_on(False)
    axes.add_artist(arrow)


def note_below(axes: Axes, text: str) -> None:
    """Write small lines under the x axis' label, on the left."""
    axes.annotate(
        text,
        (0, 0),
        (0, -0.5 * 72),
        xycoords="axes fraction",
        textcoords="offset points",
        va="top",
        fontsize=7.5,
        color="#4a5663",
        linespacing=1.5,
        annotation_clip=False,
    )


def patch_legend(axes: Axes, colours: dict[str, tuple]) -> None:
    """Name colours under the x axis' label, in columns."""
    patches = [
        Line2D([], [], marker="s", markersize=8, linestyle="", color=colour, label=name)
        for name, colour in colours.items()
    ]
    below = ScaledTranslation(0, -0.45, axes.figure.dpi_scale_trans)
    place = {"bbox_to_anchor": (0, 0), "bbox_transform": axes.transAxes + below}
    columns = 5 if axes.bbox.width / axes.figure.dpi > 5 else 2
    axes.legend(handles=patches, loc="upper left", ncol=columns, borderaxespad=0, **place)
