"""The look that all figures share, and helpers for drawing maps.

Colours of lines are Okabe and Ito's, which colour-blind readers can tell apart; those of maps are
cmocean's (Thyng et al. 2016), which are perceptually uniform and what the field is used to.
"""

from __future__ import annotations

import textwrap
from typing import Any

import matplotlib.cm
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import Colormap, ListedColormap, LogNorm, to_rgba_array
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.ticker import LogLocator
from matplotlib.transforms import Bbox, ScaledTranslation

from rbpf_svgp_slam.run.survey_run import SurveyRun

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
LEGEND_ABOVE = {"loc": "lower right", "bbox_to_anchor": (1, 1), "borderaxespad": 0.1, "ncol": 5}

LABELS = {
    "dead_reckoning": "dead reckoning",
    "online": "RBPF online",
    "estimate": "RBPF",
    "ground_truth": "ground truth",
}
COLOURS = {
    "dead_reckoning": "#D55E00",
    "online": "#56B4E9",
    "estimate": "#0072B2",
    "ground_truth": "#000000",
}
START_COLOUR, PROMPT_COLOUR, RESAMPLING_COLOUR = "#009E73", "#333333", "#CC79A7"
# Okabe and Ito's, the darker ones first, without the yellow that paper swallows.
CURVE_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
UNKNOWN_COLOUR, VEHICLE_COLOUR = "#e3e6e9", "#D55E00"
DEPTH_LABEL = "depth (m)"


def field_colour_map(name: str, fallback: str) -> Colormap:
    """Return cmocean's colour map of that name, or matplotlib's `fallback` without cmocean.

    Debian does not have cmocean, tools/requirements.sh installs it: a workspace may be without it.
    """
    try:
        from cmocean import cm
    except ImportError:
        return getattr(matplotlib.cm, fallback)
    return getattr(cm, name)


# z is up: the deepest seabed has the lowest z, and is dark blue.
DEPTH_MAP = field_colour_map("deep_r", "viridis")
SPREAD_MAP = field_colour_map("matter", "cividis")
DENSITY_MAP = field_colour_map("tempo", "YlGn")
ERROR_MAP = field_colour_map("amp", "cividis")
DIFFERENCE_MAP = field_colour_map("balance", "PuOr")
# Of lines: without the palest third, which the ground swallows.
LINE_MAP = ListedColormap(field_colour_map("dense", "plasma_r")(np.linspace(0.35, 1, 256)))

MAX_CELLS = 2000  # along an axis; a finer grid than the picture's pixels is only slow
_MAX_HEIGHT_IN = 11.5
# Height over width of a map on the page: of a flatter one its axes are low, a taller one's are wide
# enough for labels, scale bar and colour bar.
_FLATTEST, _TALLEST = 0.12, 2.5
# Of a title's characters, with the gaps between panels, into which it may go on.
_CHARACTER_IN, _SHORTEST_LINE = 0.0625, 12
_LIGHT = np.array([-0.5, 0.5, np.sqrt(0.5)])  # towards the sun: north-west, 45° high
_SHADING = 0.4  # opacity of the darkest shadow


def minutes_since_start(run: SurveyRun, stamp_s: np.ndarray) -> np.ndarray:
    """Return stamps [n] as minutes [n] since the first ping."""
    return (np.asarray(stamp_s, dtype=float) - run.stamp_s[0]) / 60


def map_subplots(
    run: SurveyRun, panels: int, max_height_in: float = _MAX_HEIGHT_IN
) -> tuple[Figure, np.ndarray]:
    """Return a figure of plan views, and its axes [rows, columns].

    As few columns as fit the height, so that the maps of an elongated survey stand on each other.
    """
    aspect = plan_aspect(run)
    for columns in (n for n in range(1, panels + 1) if panels % n == 0):
        panel_in = (WIDTH_IN - 1.4) / columns - 0.1
        height_in = panels / columns * (panel_in * aspect + 0.3) + 0.5
        # Four tall maps in a row would have no room for their bars and labels.
        if height_in <= max_height_in or columns**2 == panels:
            break
    if height_in > max_height_in:
        # A tall survey: no wider than its maps, their titles and colour bars.
        height_in = max_height_in
        panel_in = ((height_in - 0.5) * columns / panels - 0.3) / aspect
        figure_in = columns * max(panel_in + 0.8, 2.3) + 0.6
    else:
        figure_in = WIDTH_IN
    figure = Figure(figsize=(min(figure_in, WIDTH_IN), height_in))
    rows = panels // columns
    return figure, figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)


def map_axes(axes: Axes, title: str, labels: tuple[str, str] = ("x (m)", "y (m)")) -> None:
    """Make axes a plan view in metres, x to the right and y up, grey where nothing is known.

    The title has as many lines as it takes to keep off those beside it.
    """
    axes.set(xlabel=labels[0], ylabel=labels[1], facecolor=UNKNOWN_COLOUR)
    axes.set_aspect("equal", adjustable="box")
    axes.grid(False)
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    spare = 0.5 * max((top - bottom) / _TALLEST - (right - left), 0.0)
    left, right = axes.set_xlim(left - spare, right + spare)
    place_in = axes.get_position().size * axes.figure.get_size_inches()
    characters = max(int(place_in[0] / _CHARACTER_IN), _SHORTEST_LINE)
    axes.set_title(textwrap.fill(title, characters, break_long_words=False))
    m_per_in = np.max([right - left, top - bottom] / place_in)
    # As many ticks as there is room for: three labels need an inch of width.
    axes.locator_params("x", nbins=int(np.clip(3 * (right - left) / m_per_in, 1, 6)))
    axes.locator_params("y", nbins=int(np.clip(4 * (top - bottom) / m_per_in, 2, 6)))
    axes.label_outer()


def draw_grid(
    axes: Axes,
    x: np.ndarray,
    y: np.ndarray,
    z: np.ndarray,
    relief: bool = False,
    max_cells: int = MAX_CELLS,
    **style,
) -> AxesImage:
    """Draw z [nx, ny] at evenly spaced cell centres x [nx], y [ny], m; NaN cells stay blank.

    relief: z is a seabed in m, to be shaded as if the sun stood in the north-west. max_cells: along
    an axis; of more, neighbours are averaged. style: imshow's.
    """
    x, y, z = _coarser(x, y, z, -(-max(z.shape) // max_cells))
    style = {"origin": "lower", "extent": _extent(x, y), **style}
    values = np.ma.masked_invalid(z.T)
    if not relief or min(z.shape) < 2:
        return axes.imshow(values, **style)
    whole_cells = {**style, "interpolation": "nearest"}
    # What is interpolated ends at the centres of the outer cells, and shadows go on beyond them.
    axes.imshow(values, **whole_cells)
    image = axes.imshow(values, **style)
    axes.imshow(hill_shade(x, y, z).transpose(1, 0, 2), **style)
    axes.imshow(to_rgba_array(UNKNOWN_COLOUR) * np.isnan(z.T)[..., None], **whole_cells)
    return image


def draw_depths(
    axes: Axes, x: np.ndarray, y: np.ndarray, z: np.ndarray, run: SurveyRun, **style
) -> None:
    """Draw a seabed z [nx, ny], m, as draw_grid() does, in shaded relief, with a bar of depths.

    The colours are the run's own, the same in all figures. style: what is to be otherwise.
    """
    look = {"interpolation": "bilinear", "relief": True, **depth_colours(run), **style}
    depth_bar(draw_grid(axes, x, y, z, **look))


def depth_colours(run: SurveyRun) -> dict[str, Any]:
    """Return cmap, vmin and vmax, m of z, for every seabed of a run."""
    grid = run.map if run.seabed is None else run.seabed
    return {"cmap": DEPTH_MAP, **colour_limits(grid.mean)}


def _coarser(x: np.ndarray, y: np.ndarray, z: np.ndarray, by: int) -> tuple[np.ndarray, ...]:
    """Return the centres and means of blocks of `by` × `by` cells; NaN where none is known."""
    if by <= 1:
        return x, y, z
    first = [np.arange(0, n, by) for n in z.shape]

    def sums(values: np.ndarray) -> np.ndarray:
        return np.add.reduceat(np.add.reduceat(values, first[0], axis=0), first[1], axis=1)

    known = np.isfinite(z)
    count = sums(known.astype(float))
    total = sums(np.where(known, z, 0.0))
    means = np.divide(total, count, out=np.full(count.shape, np.nan), where=count > 0)
    # Even where the last block is cut short.
    x, y = (a[0] + np.arange(len(f)) * by * (a[1] - a[0]) for a, f in zip((x, y), first))
    half = 0.5 * (by - 1) / by
    x, y = (a + half * (a[1] - a[0] if len(a) > 1 else 0.0) for a in (x, y))
    return x, y, means


def _extent(x: np.ndarray, y: np.ndarray) -> tuple[float, ...]:
    """Return the outer edges of the cells: left, right, bottom, top, m."""
    half = [np.ptp(axis) / (len(axis) - 1) / 2 if len(axis) > 1 else 0.5 for axis in (x, y)]
    return x[0] - half[0], x[-1] + half[0], y[0] - half[1], y[-1] + half[1]


def hill_shade(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return the shading [nx, ny, 4], RGBA of black and white, of a seabed z [nx, ny] in m.

    Heights are exaggerated until one slope in twenty is steeper than 45°. Clear where z is NaN.
    """
    slope_x, slope_y = np.gradient(z, x, y)
    steepness = np.hypot(slope_x, slope_y)
    known = steepness[np.isfinite(steepness)]
    steep = np.percentile(known, 95) if known.size else 0.0
    scale = 1 / steep if steep > 0 else 0.0
    # Lambert: n·l, with the surface's normal n = (−∂z/∂x, −∂z/∂y, 1) / √(1 + |∇z|²)
    facing = _LIGHT[2] - scale * (_LIGHT[0] * slope_x + _LIGHT[1] * slope_y)
    light = np.nan_to_num(facing / np.hypot(1, scale * steepness) - _LIGHT[2])
    opacity = np.clip(_SHADING * np.abs(light) / _LIGHT[2], 0, _SHADING)
    white = np.where(light > 0, 1.0, 0.0)
    return np.stack([white, white, white, opacity], axis=-1)


def depth_bar(image: AxesImage) -> None:
    """Add a colour bar that tells z's of an image, m, as depths: the shallowest is on top."""
    colour_bar(image, DEPTH_LABEL, format=lambda z, _: f"{0.0 - z:g}")


def colour_bar(image: AxesImage | LineCollection, label: str, **options) -> None:
    """Add a slim colour bar beside the image's axes, as high as these, pointed where cut off.

    image: or lines that are coloured by values, a masked array. options: Figure.colorbar's.
    """
    axes, figure = image.axes, image.axes.figure
    low, high = image.get_clim()
    values = image.get_array().compressed()
    beyond = ["neither", "min", "max", "both"]
    cut = int((values < low).any()) + 2 * int((values > high).any())
    # An inset: an equal aspect leaves the axes smaller than their place in the figure, and colour
    # bars that matplotlib places by itself are as high as the place.
    inset = axes.inset_axes([1, 0, 0.1, 1])
    inset.set_axes_locator(
        lambda *_: Bbox.from_bounds(
            axes.bbox.x1 + 0.07 * figure.dpi, axes.bbox.y0, 0.13 * figure.dpi, axes.bbox.height
        ).transformed(figure.transFigure.inverted())
    )
    if isinstance(image.norm, LogNorm):
        subdivisions = (1, 2, 5) if high < 500 * low else (1,)
        options = {"ticks": LogLocator(subs=subdivisions), "format": "%g", **options}
    bar = figure.colorbar(
        image, cax=inset, label=label, extend=beyond[cut], extendfrac=0.03, **options
    )
    bar.outline.set_visible(False)


def legend_below(axes: Axes) -> None:
    """Add a legend under the label of the x axis, which a legend above might not leave room for."""
    below = ScaledTranslation(0, -0.45, axes.figure.dpi_scale_trans)
    place = {"bbox_to_anchor": (0.5, 0), "bbox_transform": axes.transAxes + below}
    axes.legend(loc="upper center", ncol=5, borderaxespad=0, **place)


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
    if not run.map.mean.size:
        return 1.0
    width, height = np.ptp(run.map.x), np.ptp(run.map.y)
    return float(np.clip(height / width, _FLATTEST, _TALLEST)) if width > 0 else 1.0
