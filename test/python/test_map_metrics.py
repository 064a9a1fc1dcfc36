"""Errors of a map and the plain grid beside it, against closed forms."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rbpf_svgp_slam.metrics import cells, map_metrics
from rbpf_svgp_slam.run.survey_run import GridMap


def test_msll_of_the_trivial_predictor_is_zero():
    z = np.random.default_rng(1).normal(-20, 2, 500)
    trivial = np.full(500, z.mean()), np.full(500, z.var())
    assert map_metrics.msll(z, *trivial, z.mean(), z.var()) == pytest.approx(0, abs=1e-12)


def test_msll_of_the_exact_predictor_is_the_log_ratio_of_the_spreads():
    # E[msll] = log(σ/s) for z ~ N(0, s²): with 200,000 draws the two quadratic terms, each of
    # mean 1/2 and std 1/√2, leave a standard error below 0.003; five of them are allowed.
    rng = np.random.default_rng(2)
    mean = rng.normal(0, 3, 200_000)
    z = mean + rng.normal(0, 0.3, mean.size)
    score = map_metrics.msll(z, mean, np.full(mean.size, 0.09), 0.0, 9.09)
    assert score == pytest.approx(np.log(0.3 / np.sqrt(9.09)), abs=0.015)


def test_grid_takes_the_nearest_filled_cell_within_the_neighbourhood():
    training = np.array([[0.2, 0.5, -1.0], [0.8, 0.5, -3.0], [5.5, 0.5, -7.0]])
    xy = np.array([[0.9, 0.9], [1.2, 1.9], [3.5, 0.5], [4.1, -0.3], [-0.5, 0.5]])
    z = map_metrics.grid_prediction(training, xy)
    np.testing.assert_allclose(z, [-2.0, -2.0, np.nan, -7.0, -2.0])
    assert np.isnan(map_metrics.grid_prediction(np.empty((0, 3)), xy)).all()


@given(st.tuples(*[st.floats(-1e6, 1e6)] * 2), st.sampled_from([0.5, 1.0, 2.0]))
def test_cell_keys_name_the_cell_that_holds_the_point(xy, resolution_m):
    key = cells.cell_keys(np.array([xy]), resolution_m)
    centre = cells.cell_centres(key, resolution_m)[0]
    np.testing.assert_array_equal(
        np.floor(centre / resolution_m), np.floor(np.array(xy) / resolution_m)
    )
    around = cells.cell_centres(cells.neighbour_keys(key)[0], resolution_m)
    steps = {tuple(step) for step in np.round((around - centre) / resolution_m).astype(int)}
    assert steps == set(itertools.product((-1, 0, 1), repeat=2))


def test_grid_on_a_map_leaves_out_what_lies_beyond_it():
    grid = GridMap(np.arange(3.0), np.arange(2.0), np.zeros((3, 2)))
    points = np.array([[0.4, 0.4, 1.0], [-0.4, -0.4, 3.0], [2.4, 1.4, 5.0], [2.6, 0.0, 9.0]])
    expected = [[2.0, np.nan], [np.nan, np.nan], [np.nan, 5.0]]
    np.testing.assert_array_equal(map_metrics.grid_on(grid, points), expected)
