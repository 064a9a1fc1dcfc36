"""What a hydrographer looks at first: the chart, and how good it is.

Each function returns a figure and its caption, or None where the run has no data for it. Both are
drawn in the CRS of `survey_epsg` where `survey_origin` tells where the survey is, else in the map
frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, LogNorm

from rbpf_svgp_slam.charts import s44
from rbpf_svgp_slam.charts.chart import Chart, make_chart
from rbpf_svgp_slam.charts.charted_seabed import charted_seabed
from rbpf_svgp_slam.charts.georeference import Georeference, LocalFrame, georeference_of
from rbpf_svgp_slam.figures import chart_marks as marks
from rbpf_svgp_slam.figures import figure_style as style
from rbpf_svgp_slam.figures.track_figures import Drawn
from rbpf_svgp_slam.metrics.evaluation import Evaluation
from rbpf_svgp_slam.run.survey_run import SurveyRun

# More cannot be seen in a figure.
_MOST_CELLS = 1_000_000
_ORDER_COLOURS = {
    "none": "#D55E00",
    "2": "#E69F00",
    "1a, 1b": "#F0E442",
    "Special": "#56B4E9",
    "Exclusive": "#0072B2",
}
LOCAL_FRAME = "local frame, without survey_origin: place and north are unknown"


@dataclass
class _Sheet:
    """A chart as draw_grid() takes it: layers [nx, ny], x to the right and y up."""

    chart: Chart
    x: np.ndarray  # [nx] easting, m, or map's x
    y: np.ndarray  # [ny]

    @property
    def georeference(self) -> Georeference | None:
        place = self.chart.georeference
        return place if isinstance(place, Georeference) else None

    def layer(self, values: np.ndarray) -> np.ndarray:
        """Values [rows, columns] of the chart, NaN where no beam fell, as [nx, ny]."""
        return np.where(self.chart.known, values, np.nan)[::-1].T

    def axes(self, axes: Axes, title: str) -> None:
        """Make axes a chart: units, scale bar, and north where it is known."""
        local, on_earth = ("x (m)", "y (m)"), ("easting (m)", "northing (m)")
        style.map_axes(axes, title, local if self.georeference is None else on_earth)
        axes.ticklabel_format(style="plain", useOffset=False)
        # Eastings have six digits or seven.
        width_in = axes.get_position().width * axes.figure.get_figwidth()
        axes.locator_params("x", nbins=int(np.clip(width_in / 0.8, 1, 6)))


def _sheet(run: SurveyRun) -> _Sheet | None:
    """None where the run has no seabed."""
    seabed = charted_seabed(run)
    if seabed is None:
        return None
    try:
        place = georeference_of(run.config)
    except ValueError:  # of which report.json's notes tell
        place = None
    chart = make_chart(seabed, place or LocalFrame(), _MOST_CELLS)
    return _Sheet(chart, chart.easting, chart.northing[::-1])


def depth_chart(run: SurveyRun, evaluation: Evaluation) -> Drawn:
    """Draw depths with contours, scale bar, north arrow, and what they are measured in."""
    sheet = _sheet(run)
    if sheet is None:
        return None
    figure, [[axes]] = style.map_subplots(run, 1)
    z = sheet.layer(sheet.chart.elevation)
    style.draw_depths(axes, sheet.x, sheet.y, z, run)
    interval_m = marks.draw_contours(axes, sheet.x, sheet.y, z)
    sheet.axes(axes, "Depth")
    marks.draw_scale_bar(axes)
    if sheet.georeference is not None:
        marks.draw_north_arrow(axes)
    contours = f"contours every {interval_m:g} m" if interval_m else "no contours"
    cells = f"cells of {sheet.chart.resolution_m:g} m"
    marks.note_below(
        axes,
        f"{frame_of(sheet.georeference)}\n{datum_of(sheet.georeference)}\n" f"{contours}, {cells}",
    )
    return figure, (
        "Depths of the final trajectory's seabed, in shaded relief lit from the north-west, with "
        f"{contours}. Grey where no beam fell within a cell."
    )


def frame_of(place: Georeference | None) -> str:
    """What the chart's coordinates are."""
    return LOCAL_FRAME if place is None else f"EPSG:{place.epsg}, {place.name}; grid north is up"


def datum_of(place: Georeference | None) -> str:
    """What its depths count from."""
    below = "depths in m below the water's surface"
    if place is None:
        return f"{below}, no tide or datum applied"
    return f"{below}, taken as {place.vertical_name} (EPSG:{place.vertical_epsg}); no tide applied"


def survey_quality(run: SurveyRun, evaluation: Evaluation) -> Drawn:
    """Draw sounding density, total vertical uncertainty and its main share, and S-44's orders."""
    sheet = _sheet(run)
    if sheet is None:
        return None
    has_spread = np.isfinite(sheet.chart.std).any()
    figure, panels = style.map_subplots(run, 4 if has_spread else 1)
    density, *others = panels.flat
    _draw_density(density, sheet)
    marks.draw_scale_bar(density)
    if sheet.georeference is not None:
        marks.draw_north_arrow(density)
    caption = "Soundings per square metre, those that the seabed is made of, on a logarithmic scale"
    if has_spread:
        total, seabed, orders = others
        _draw_spread(total, sheet, sheet.chart.std, "Total vertical uncertainty", "TVU")
        _draw_spread(seabed, sheet, sheet.chart.seabed_std, "Of it, the seabed's mean", "1.96 σ")
        _draw_orders(orders, sheet)
        caption += (
            "; total vertical uncertainty of a depth, 95 %: of the seabed's mean, of a beam about "
            "it, and of the trajectory times the slope; its first share alone; and the strictest "
            "order of IHO S-44 (edition 6.1.0) whose vertical uncertainty it keeps. Not in it: "
            "tide and datum, draft, sound speed, the sonar's mount"
        )
    return figure, f"{caption}. Grey where no beam fell within a cell."


def _draw_density(axes: Axes, sheet: _Sheet) -> None:
    density = sheet.layer(sheet.chart.density / sheet.chart.resolution_m**2)
    positive = density[density > 0]
    limits = style.colour_limits(positive)
    scale = {"norm": LogNorm(**limits)} if 0 < limits["vmin"] < limits["vmax"] else limits
    # A logarithm of none is none, which would be grey: those beside a sounding are the sparsest.
    sparse = np.where(density == 0, limits["vmin"], density)
    image = style.draw_grid(axes, sheet.x, sheet.y, sparse, cmap=style.DENSITY_MAP, **scale)
    style.colour_bar(image, "soundings (1/m²)")
    sheet.axes(axes, "Sounding density")


def _draw_spread(axes: Axes, sheet: _Sheet, std_m: np.ndarray, title: str, label: str) -> None:
    """Draw what 95 % lie within, of standard deviations [rows, columns] of the chart."""
    spread_m = s44.SIGMAS_95 * sheet.layer(std_m)
    limits = style.colour_limits(spread_m)
    image = style.draw_grid(axes, sheet.x, sheet.y, spread_m, cmap=style.SPREAD_MAP, **limits)
    style.colour_bar(image, f"{label}, 95 % (m)")
    sheet.axes(axes, title)


def _draw_orders(axes: Axes, sheet: _Sheet) -> None:
    codes = np.where(sheet.chart.order == s44.UNKNOWN, np.nan, sheet.chart.order)
    names = [name for _, name in sorted(s44.NAMES.items())]
    colours = ListedColormap([_ORDER_COLOURS[name] for name in names])
    # Not averaged with their neighbours, as draw_grid() would: a code is no quantity.
    every = -(-max(codes.shape) // style.MAX_CELLS)
    layer = sheet.layer(codes)[::every, ::every]
    scale = {"cmap": colours, "vmin": -0.5, "vmax": len(names) - 0.5, "interpolation": "nearest"}
    style.draw_grid(axes, sheet.x[::every], sheet.y[::every], layer, **scale)
    sheet.axes(axes, "Order of S-44 by TVU")
    shares = s44.shares(sheet.chart.order)
    marks.patch_legend(
        axes,
        {f"{name}: {100 * share:.1f} %": _ORDER_COLOURS[name] for name, share in shares.items()},
    )
