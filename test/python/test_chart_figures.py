"""The report's chart: where it lies, its marks, and what it says of its quality."""

import matplotlib
import numpy as np
import pytest
from made_up_survey import ORIGIN_DEG, without
from matplotlib.figure import Figure
from matplotlib.offsetbox import AnchoredOffsetbox

from rbpf_svgp_slam.charts import s44
from rbpf_svgp_slam.charts.charted_seabed import charted_seabed
from rbpf_svgp_slam.charts.uncertainty import total_variance
from rbpf_svgp_slam.figures import chart_figures, chart_marks
from rbpf_svgp_slam.figures.figure_style import STYLE, draw_grid, map_axes
from rbpf_svgp_slam.figures.report_figures import to_png


@pytest.fixture(scope="module")
def few(run):
    """So few beams that the best particle's map is charted, which takes no time to make."""
    return without(run, levelled=run.levelled[:3900], ping_of_beam=run.ping_of_beam[:3900])


def views(figure):
    return [axes for axes in figure.axes if axes.images]


def notes_of(axes):
    return " ".join(text.get_text() for text in axes.texts)


def marks_of(axes):
    return [artist for artist in axes.artists if isinstance(artist, AnchoredOffsetbox)]


def test_a_chart_without_a_place_has_no_north_and_says_so(few):
    figure, _ = chart_figures.depth_chart(few, None)
    [axes] = views(figure)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x (m)", "y (m)")
    assert "north are unknown" in notes_of(axes) and "EPSG" not in notes_of(axes)
    assert len(marks_of(axes)) == 1  # the scale bar
    # The map's cells, moved by half of one to round edges: it shows what is charted.
    shown = axes.images[0].get_array()
    seabed = charted_seabed(few).seabed
    assert (~np.ma.getmaskarray(shown)).sum() == pytest.approx(
        np.isfinite(seabed.mean).sum(), rel=0.05
    )
    left, right, bottom, top = axes.images[0].get_extent()
    placed = few.beams
    assert left <= placed[:, 0].min() + 1 and placed[:, 0].max() - 1 <= right
    assert bottom <= placed[:, 1].min() + 1 and placed[:, 1].max() - 1 <= top


def test_a_chart_with_a_place_is_in_its_crs_north_up(few):
    placed = without(few, config={"survey_origin": ORIGIN_DEG})
    figure, caption = chart_figures.depth_chart(placed, None)
    [axes] = views(figure)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("easting (m)", "northing (m)")
    assert "EPSG:32632" in notes_of(axes) and "MSL height (EPSG:5714)" in notes_of(axes)
    assert len(marks_of(axes)) == 2  # the scale bar and the north arrow
    left, right, bottom, top = axes.images[0].get_extent()
    assert 500_000 < left < right < 834_000 and 6_300_000 < bottom < top < 6_450_000
    assert "contours every" in caption
    assert to_png(figure).startswith(b"\x89PNG")
    # A CRS that is none: report.json's notes say why, and the chart is the map frame's.
    wrong = without(few, config={"survey_origin": ORIGIN_DEG, "survey_epsg": 4326})
    [axes] = views(chart_figures.depth_chart(wrong, None)[0])
    assert axes.get_xlabel() == "x (m)"


def test_a_narrow_survey_has_room_for_labels_and_marks():
    """As of a ship that lies alongside: its swath is a line."""
    axes = Figure().add_subplot()
    draw_grid(axes, np.arange(2.0), np.arange(32.0), np.zeros((2, 32)))
    map_axes(axes, "Depth")
    assert axes.get_ylim() == (-0.5, 31.5)
    # 32 m by 2.5, about the middle
    assert axes.get_xlim() == pytest.approx((0.5 - 6.4, 0.5 + 6.4))


def test_contours_are_at_round_depths_and_labelled_with_them():
    x, y = np.arange(60.0), np.arange(40.0)
    axes = Figure().add_subplot()
    z = np.broadcast_to(-20.2 - 0.1 * x[:, None], (60, 40))
    assert chart_marks.draw_contours(axes, x, y, z) == 0.5
    labels = {float(text.get_text()) for text in axes.texts}
    assert labels == {22.5, 25.0}  # every fifth
    # On a plane a contour is where its depth is: z = -22.5 m at x = 23 m.
    ends = [path.vertices[:, 0] for line in axes.collections for path in line.get_paths()]
    assert any(np.allclose(x_m, 23.0) for x_m in ends if len(x_m))
    assert chart_marks.draw_contours(axes, x, y, np.full((60, 40), -20.0)) is None
    assert chart_marks.draw_contours(axes, x[:1], y, z[:1]) is None


@pytest.mark.parametrize("width_m, bar_m", [(240, 50), (90, 20), (1000, 200), (9000, 2000), (0, 0)])
def test_a_scale_bar_is_round_and_a_quarter_of_the_chart_at_most(width_m, bar_m):
    assert chart_marks.scale_bar_m(width_m) == pytest.approx(bar_m, abs=1e-3)


def test_quality_shows_density_uncertainty_and_orders(few):
    with matplotlib.rc_context(STYLE):
        figure, caption = chart_figures.survey_quality(few, None)
    titles = [axes.get_title(loc="left") for axes in views(figure)]
    assert titles[:2] == ["Sounding density", "Total vertical uncertainty"]
    assert titles[3] == "Order of S-44 by TVU" and "Not in it: tide" in caption
    seabed = charted_seabed(few)
    shares = s44.shares(s44.orders_met(seabed.seabed.mean, np.sqrt(total_variance(seabed))))
    legend = views(figure)[3].get_legend().get_texts()
    shown = {
        name: float(share.rstrip(" %")) / 100
        for name, share in (text.get_text().split(": ") for text in legend)
    }
    # The chart's grid lies half a cell beside the map's.
    assert shown == pytest.approx(shares, abs=0.05)
    masks = [np.ma.getmaskarray(axes.images[0].get_array()) for axes in views(figure)]
    assert all((mask == masks[0]).all() for mask in masks)


def test_quality_of_a_map_of_unknown_variance_is_its_density_alone(few):
    grid = without(few.map, variance=None)
    figure, caption = chart_figures.survey_quality(without(few, map=grid), None)
    assert len(views(figure)) == 1 and "S-44" not in caption


def test_shares_within_an_order_hold_those_of_stricter_ones():
    shares = {"Exclusive": 0.1, "Special": 0.2, "1a, 1b": 0.3, "2": 0.0, "none": 0.4}
    within = s44.shares_within(shares)
    assert within == pytest.approx({"Exclusive": 0.1, "Special": 0.3, "1a, 1b": 0.6, "2": 0.6})
