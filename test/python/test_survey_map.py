"""The seabed of a finished survey: as good as its beams, and silent where there are none."""

import dataclasses

import numpy as np
import pytest
from made_up_survey import NOISE_M, make_run, seabed

from rbpf_svgp_slam.gmrf import survey_map
from rbpf_svgp_slam.gmrf.survey_map import SurveyMap
from rbpf_svgp_slam.metrics.evaluation import evaluate
from rbpf_svgp_slam.metrics.map_metrics import rmse
from rbpf_svgp_slam.metrics.metric_names import SEABED_METRICS


@pytest.fixture(scope="module")
def exact():
    """The survey placed where it really was."""
    run = make_run()
    return dataclasses.replace(run, estimate=run.ground_truth)


@pytest.fixture(scope="module")
def report(exact):
    return evaluate(exact).report


def test_held_out_beams_are_predicted_better_than_by_a_plain_grid(exact, report):
    assert NOISE_M < report["seabed_rmse_m"] < 0.95 * report["grid_rmse_m"]
    assert report["seabed_coverage"] > 0.97
    assert report["seabed_interval95_coverage"] == pytest.approx(0.95, abs=0.03)
    assert report["seabed_noise_std_m"] == pytest.approx(NOISE_M, rel=0.15)
    assert report["seabed_msll"] < -1.0
    assert report["seabed_spacing_m"] == 1.0
    assert report["seabed_terrain_rmse_m"] < NOISE_M
    assert all(report[name] is not None for name in SEABED_METRICS)


def test_it_lies_on_the_maps_cells_and_is_masked_where_no_beam_fell(exact):
    grid = exact.seabed
    assert grid.mean.shape == exact.map.mean.shape
    known = np.isfinite(grid.mean)
    np.testing.assert_array_equal(known, np.isfinite(grid.variance))
    training = exact.beams[~exact.held_out[exact.ping_of_beam]]
    for i, j in np.random.default_rng(0).integers(0, grid.mean.shape, (200, 2)):
        away_m = np.abs(training[:, :2] - [grid.x[i], grid.y[j]]).max(axis=1).min()
        # A beam says something of the nodes of its cell; at the border it may go either way.
        assert known[i, j] == (away_m < 1.0) or abs(away_m - 1.0) < 1e-6


def test_held_out_beams_are_left_out(exact):
    levelled = exact.levelled.copy()
    levelled[exact.held_out[exact.ping_of_beam], 2] += 5.0
    other = dataclasses.replace(exact, levelled=levelled)
    np.testing.assert_array_equal(other.seabed.mean, exact.seabed.mean)


def test_outliers_hardly_move_it(exact):
    levelled = exact.levelled.copy()
    wrong = np.random.default_rng(1).random(len(levelled)) < 0.02
    levelled[wrong, 2] += 4.0
    rough = dataclasses.replace(exact, levelled=levelled).seabed
    assert rmse((rough.mean - exact.seabed.mean)[np.isfinite(rough.mean)]) < 0.05


def test_its_mean_is_the_seabed_and_its_variance_says_how_well(exact):
    xy = np.random.default_rng(2).uniform([5, 5], [95, 45], (2000, 2))
    mean, variance = exact.seabed_map.predict(xy)
    known = np.isfinite(mean)
    assert known.mean() > 0.97
    error = (mean - seabed(xy))[known]
    assert rmse(error) < NOISE_M
    assert np.mean(error**2 / variance[known]) == pytest.approx(1.0, abs=0.7)


@pytest.mark.parametrize("beams", [0, 1, 3999])
def test_too_few_beams_make_no_seabed_and_the_report_says_so(exact, beams):
    few = dataclasses.replace(
        exact, levelled=exact.levelled[:beams], ping_of_beam=exact.ping_of_beam[:beams]
    )
    training = int((~few.held_out[few.ping_of_beam]).sum())
    assert few.seabed is None and few.seabed_map is None
    report = evaluate(few).report
    assert [report[name] for name in SEABED_METRICS] == [None] * len(SEABED_METRICS)
    why = f"{training} beams to make it from; expected at least 4000, to learn its model"
    assert f"no seabed of the final trajectory: {why}" in report["notes"]


def test_beams_without_a_place_are_no_beams(exact):
    lost = dataclasses.replace(exact, estimate=np.full_like(exact.estimate, np.nan))
    assert lost.why_no_seabed.startswith("0 beams")


def test_a_survey_of_too_many_nodes_is_mapped_more_coarsely(exact, monkeypatch):
    monkeypatch.setattr(survey_map, "MOST_NODES", 3000)
    coarse = dataclasses.replace(exact)
    assert coarse.seabed_map.spacing_m == 2.0
    assert any("on nodes 2 m apart" in note for note in evaluate(coarse).report["notes"])


def test_beams_far_from_all_others_do_no_harm():
    rng = np.random.default_rng(3)
    xy = rng.uniform(0, 40, (6000, 2))
    beams = np.column_stack([xy, seabed(xy) + NOISE_M * rng.standard_normal(len(xy))])
    beams[::1500, :2] += 1e5
    mean, _ = SurveyMap(beams, 1.0, np.zeros(2)).predict(xy)
    known = np.isfinite(mean)
    assert known.mean() > 0.98 and rmse(mean[known] - seabed(xy[known])) < NOISE_M


def test_beside_a_line_of_beams_along_a_wall_nothing_is_known():
    """As of a ship alongside a quay: which way the wall leans the beams say, how far nobody."""
    rng = np.random.default_rng(4)
    x, y = rng.uniform(0.44, 0.46, 20_000), rng.uniform(0.0, 30.0, 20_000)
    wall = y < 3.0
    z = np.where(wall, -10.0 - 30.0 * (x - 0.44), -12.0) + 0.01 * rng.standard_normal(len(x))
    seabed_map = SurveyMap(np.column_stack([x, y, z]), 1.0, np.zeros(2))
    mean, variance = seabed_map.predict(np.array([[0.0, 1.0], [1.0, 1.0], [0.45, 20.0]]))
    assert np.isnan(mean[:2]).all() and np.isnan(variance[:2]).all()
    assert mean[2] == pytest.approx(-12.0, abs=0.05)
