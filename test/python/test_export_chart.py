"""The exported grid, its uncertainty and the orders of S-44, against closed forms."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from made_up_survey import seabed

from rbpf_svgp_slam.charts import s44
from rbpf_svgp_slam.charts.chart import make_chart
from rbpf_svgp_slam.exports.exported_run import ExportedRun, load_exported_run
from rbpf_svgp_slam.charts.georeference import Georeference
from rbpf_svgp_slam.charts.uncertainty import position_variance, slopes
from rbpf_svgp_slam.charts.contours import contour_interval_m
from rbpf_svgp_slam.run.survey_run import GridMap
from rbpf_svgp_slam.survey_area.grid import grid_points

SLOPE = np.array([0.3, -0.2])
BEAMS_XY = np.array([[10.0, 20.0], [14.0, 20.0]])


def plane(xy):
    return -40 + np.asarray(xy) @ SLOPE


def make_exported(covariance=None, known=lambda x, y: np.full((len(x), len(y)), True)):
    """A sloping plane on 1 m cells, two beams of one ping at the origin."""
    x, y = np.arange(-30, 41.0), np.arange(-20, 51.0)
    mean = -40 + SLOPE[0] * x[:, None] + SLOPE[1] * y
    mean[~known(x[:, None], y)] = np.nan
    poses = np.zeros((1, 6))
    return ExportedRun(
        folder=Path("nowhere"),
        source="seabed.npz",
        seabed=GridMap(x, y, mean, np.where(np.isnan(mean), np.nan, 0.02**2)),
        noise_variance_m2=0.05**2,
        stamp_s=np.array([1.6e9]),
        poses=poses,
        covariance=covariance,
        beams=np.column_stack([BEAMS_XY, plane(BEAMS_XY)]),
        ping_of_beam=np.array([0, 0]),
        config={},
    )


def test_the_trajectorys_share_is_the_variance_of_depths_under_drawn_poses():
    rng = np.random.default_rng(0)
    root = rng.standard_normal((3, 3)) * [[0.3], [0.2], [0.01]]
    covariance = root @ root.T
    run = make_exported(covariance[np.triu_indices(3)][None])
    share = position_variance(run)
    draws = 200_000
    dx, dy, dyaw = (root @ rng.standard_normal((3, draws)))[:, :, None]
    # A beam that is moved by its ping's error meets the plane's depth of elsewhere.
    moved_x = dx + np.cos(dyaw) * BEAMS_XY[:, 0] - np.sin(dyaw) * BEAMS_XY[:, 1]
    moved_y = dy + np.sin(dyaw) * BEAMS_XY[:, 0] + np.cos(dyaw) * BEAMS_XY[:, 1]
    drawn = (moved_x * SLOPE[0] + moved_y * SLOPE[1]).var(axis=0)
    i, j = np.searchsorted(run.seabed.x, BEAMS_XY[:, 0]), np.searchsorted(run.seabed.y, 20.0)
    # A variance of so many draws is known to 0.3 %; the rotation is linear to 1e-4.
    np.testing.assert_allclose(share[i, j], drawn, rtol=0.02)
    # Cells without a beam have the nearest one's.
    assert share[0, 0] == pytest.approx(share[i[0], j])


def test_without_covariances_the_trajectorys_share_is_none():
    assert not position_variance(make_exported()).any()


def test_slopes_are_the_planes_up_to_its_rim():
    run = make_exported(known=lambda x, y: np.hypot(x - 5, y - 15) < 20)
    along_x, along_y = slopes(run.seabed.mean, run.seabed.x, run.seabed.y)
    np.testing.assert_allclose(along_x, SLOPE[0], atol=1e-12)
    np.testing.assert_allclose(along_y, SLOPE[1], atol=1e-12)


@pytest.mark.parametrize("epsg", [0, 32631, 3857])
def test_the_grid_has_the_seabed_where_it_is(epsg):
    """Bilinear interpolation has no error on a plane, whatever the grid's turn and scale."""
    disc = {"known": lambda x, y: np.hypot(x - 5, y - 15) < 20}
    run, georeference = make_exported(**disc), Georeference((57.5, 11.2), epsg)
    chart = make_chart(run, georeference)
    row, column = np.nonzero(chart.known)
    xy = georeference.from_projected(np.column_stack([chart.easting[column], chart.northing[row]]))
    inner = np.hypot(*(xy - [5, 15]).T) < 18
    expected = plane(xy)
    np.testing.assert_allclose(chart.elevation[chart.known][inner], expected[inner], atol=1e-6)
    # At the rim only the known ones of the four cells count: half a cell's slope and no more.
    assert np.abs(chart.elevation[chart.known] - expected).max() < np.abs(SLOPE).sum()
    # Masked as the map is: where the nearest cell is.
    nearest = np.rint(xy)
    assert (np.hypot(*(nearest - [5, 15]).T) < 20).all()
    ground = np.isfinite(run.seabed.mean).sum() * np.linalg.det(turn_and_scale(georeference))
    # A rim of 2π 20 m, known to a part of a cell.
    assert len(row) == pytest.approx(ground, rel=0.02)


def turn_and_scale(georeference):
    origin, east, north = georeference.projected([[0, 0], [1, 0], [0, 1]])
    return np.column_stack([east - origin, north - origin])


def test_beams_are_counted_where_they_fell():
    run, georeference = make_exported(), Georeference((57.5, 11.2))
    chart = make_chart(run, georeference)
    assert chart.density.sum() == 2
    row, column = np.nonzero(chart.density)
    en = np.column_stack([chart.easting[column], chart.northing[row]])
    fell = georeference.projected(BEAMS_XY)
    for place in fell:
        assert np.abs(en - place).max(axis=1).min() <= 0.5 + 1e-9


def test_a_chart_that_no_memory_holds_is_coarser(monkeypatch):
    run, georeference = make_exported(), Georeference((57.5, 11.2))
    fine = make_chart(run, georeference)
    monkeypatch.setattr("rbpf_svgp_slam.charts.chart.MOST_CELLS", 1000)
    coarse = make_chart(run, georeference)
    assert (fine.resolution_m, coarse.resolution_m) == (1.0, 4.0)
    assert coarse.elevation.size <= 1000 and coarse.density.sum() == fine.density.sum()
    row, column = np.nonzero(coarse.known)
    en = np.column_stack([coarse.easting[column], coarse.northing[row]])
    xy = georeference.from_projected(en)
    inner = ((xy > [-30, -20]) & (xy < [40, 50])).all(axis=1)
    np.testing.assert_allclose(coarse.elevation[coarse.known][inner], plane(xy)[inner], atol=1e-6)


def test_all_shares_make_the_standard_deviation():
    run = make_exported(np.array([[0.2**2, 0, 0, 0.1**2, 0, 0]]))
    chart = make_chart(run, Georeference((57.5, 11.2)))
    position = (0.3 * 0.2) ** 2 + (0.2 * 0.1) ** 2
    np.testing.assert_allclose(chart.position_std[chart.known], np.sqrt(position), rtol=1e-6)
    np.testing.assert_allclose(chart.seabed_std[chart.known], 0.02, rtol=1e-6)
    expected = np.sqrt(0.02**2 + 0.05**2 + position)
    np.testing.assert_allclose(chart.std[chart.known], expected, rtol=1e-6)


def test_the_true_seabed_lies_within_it(placed_folder):
    """Of a survey whose ripples are steep, with a track that errs by half a metre."""
    run = load_exported_run(placed_folder)
    error = run.seabed.mean - seabed(grid_points(run.seabed.x, run.seabed.y)).reshape(
        run.seabed.mean.shape
    )
    known = np.isfinite(error)
    shares = [
        np.mean(np.abs(error[known]) < s44.SIGMAS_95 * np.sqrt(variance[known]))
        for variance in (run.seabed.variance, run.seabed.variance + position_variance(run))
    ]
    # Of 95 %; the map alone is too sure, since it takes its beams for where they are said to be.
    assert shares[0] < 0.9 < shares[1], shares


def test_a_map_is_masked_as_the_seabed_is(placed_folder, tmp_path):
    """map.npz guesses everywhere; what stays of it is where beams fell, as in seabed.npz."""
    without = shutil.copytree(placed_folder, tmp_path / "run")
    (without / "seabed.npz").unlink()
    with_seabed, with_map = load_exported_run(placed_folder), load_exported_run(without)
    assert (with_seabed.source, with_map.source) == ("seabed.npz", "map.npz")
    by_seabed, by_map = (np.isfinite(run.seabed.mean) for run in (with_seabed, with_map))
    surveyed = np.isfinite(np.load(placed_folder / "map.npz")["mean"])
    # Some beams lie on the line between two cells; the files have them in float32.
    assert (by_map == (by_seabed & surveyed)).mean() > 0.998
    np.testing.assert_allclose(with_map.noise_variance_m2, 0.1**2)


# S-44


@pytest.mark.parametrize(
    "depth_m, limits_m",
    # From the formula, by hand: sqrt(a² + (b d)²).
    [(0.0, [1.0, 0.5, 0.25, 0.15]), (100.0, [2.508, 1.393, 0.791, 0.765])],
)
def test_orders_by_the_vertical_uncertainty_that_they_allow(depth_m, limits_m):
    allowed = [order.largest_m(depth_m) for order in s44.ORDERS]
    np.testing.assert_allclose(allowed, limits_m, atol=5e-4)
    std_m = np.array([0.99, 1.01]) * np.array(limits_m)[:, None] / s44.SIGMAS_95
    met = s44.orders_met(np.full((4, 2), -depth_m), std_m)
    np.testing.assert_array_equal(met, [[1, 0], [2, 1], [3, 2], [4, 3]])


def test_shares_are_of_the_cells_with_a_seabed():
    codes = s44.orders_met(np.array([-10.0, -10.0, np.nan]), np.array([0.05, 5.0, np.nan]))
    assert codes.tolist() == [4, 0, s44.UNKNOWN]
    expected = {"Exclusive": 0.5, "Special": 0, "1a, 1b": 0, "2": 0, "none": 0.5}
    assert s44.shares(codes) == expected and list(s44.shares(codes)) == list(expected)


# Contours


@pytest.mark.parametrize(
    "range_m, interval_m", [(12.7, 1), (0.7, 0.05), (40, 2), (41, 5), (1000, 50), (0, 0.001)]
)
def test_contours_are_at_round_depths(range_m, interval_m):
    assert contour_interval_m(np.array([[-50.0 - range_m, -50.0, np.nan]])) == interval_m
