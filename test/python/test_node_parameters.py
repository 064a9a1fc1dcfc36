"""The map nodes' parameters, shares of particles, and grid over the survey area."""

import copy
from pathlib import Path

import numpy as np
import pytest
import yaml

from rbpf_svgp_slam.maps import make_group
from rbpf_svgp_slam.parameters.loading import ParameterError, validate, validate_index
from rbpf_svgp_slam.protocol.shares import owner, share
from rbpf_svgp_slam.survey_area.grid import survey_grid
from rbpf_svgp_slam.survey_area.polygon import survey_origin

DEFAULT = Path(__file__).parents[2] / "config" / "default.yaml"
SHARES = Path(__file__).parents[1] / "data" / "particle_shares.txt"
TRIANGLE = [[0.0, 0.0], [40, 0], [0, 20.0]]


@pytest.fixture
def tree():
    parameters = yaml.safe_load(DEFAULT.read_text())
    parameters["survey_area"] = copy.deepcopy(TRIANGLE)
    return parameters


def test_the_shipped_parameters_are_accepted(tree):
    parameters = validate(tree)
    assert parameters.particles == tree["particles"]
    assert vars(parameters.map) == tree["map"]
    assert parameters.engine_group == tree["svgp"]
    maps = make_group(parameters)
    assert maps.minibatch_size == tree["svgp"]["minibatch_size"]
    assert parameters.survey_area == ((0, 0), (40, 0), (0, 20))
    assert parameters.survey_origin == () and parameters.survey_epsg == 0
    assert validate({**tree, "survey_origin": [57.5, 11]}).survey_origin == (57.5, 11.0)


@pytest.mark.parametrize(
    "path, value, message",
    [
        ("particles", 0, "particles is 0; expected an integer in 1 .. 100000"),
        ("particles", 2.0, "particles is 2.0; expected an integer in 1"),
        ("particles", True, "particles is True; expected an integer"),
        ("nodes", 41, "nodes is 41; expected at most 40"),
        ("seed", -1, "seed is -1; expected an integer in 0 .. 2147483647"),
        ("survey_area", [], r"survey_area is \[\]; expected a polygon"),
        ("survey_area", [[0, 0], [1, 1], [2, 2]], "survey_area .* encloses an area"),
        ("survey_area", [[0, 0], [1, 1], [2, float("nan")]], "survey_area .* finite"),
        ("survey_origin", [57.5], r"survey_origin is \[57.5\]; expected \[latitude, longitude\]"),
        ("survey_origin", [97.5, 11], r"survey_origin .* within \+-90 and \+-360, or \[\]"),
        ("survey_epsg", "32632", "survey_epsg is '32632'; expected an integer in 0 .. 999999"),
        ("frames/map", "", "frames/map is ''; expected a name"),
        ("resampling/timeout_s", 0.0, "timeout_s is 0.0; expected a number from 0.1 to"),
        ("map/engine", "kriging", "map/engine is 'kriging'; expected one of svgp"),
        ("map/resolution_m", float("inf"), "map/resolution_m is inf; expected a number from"),
        ("map/tiles", 3, "map/tiles is unknown; expected one of engine, threads"),
        ("map/resolution_m", "1e-1", "map/resolution_m is '1e-1'; .* in YAML write 1.0e-4"),
        (
            "map/resolution_m",
            0.001,
            r"map/resolution_m is 0.001, which divides the 40 m x 20 m of "
            r"rbpf_svgp_slam/survey_area into 8e\+08 cells; expected at most 25,000,000",
        ),
        ("survey_area", [[0, 0], [1, 0]] + [[0, 1]] * 9_999, "polygon .* of 3 to 10000 finite"),
        ("svgp", 3, "svgp is 3; expected a group of parameters"),
    ],
)
def test_bad_values_are_refused_with_name_value_and_expectation(tree, path, value, message):
    *groups, leaf = path.split("/")
    branch = tree
    for group in groups:
        branch = branch[group]
    branch[leaf] = value
    with pytest.raises(ParameterError, match=message):
        validate(tree)


def test_missing_parameters_are_named(tree):
    del tree["map"]["threads"]
    with pytest.raises(ParameterError, match="rbpf_svgp_slam/map/threads is not set"):
        validate(tree)
    with pytest.raises(ParameterError, match="expected the parameters of config/default.yaml"):
        validate({})


@pytest.mark.parametrize("index", [None, -1, 2, 1.0, True, "0"])
def test_bad_indices_are_refused(index):
    with pytest.raises(ParameterError, match="~index is .*; expected an integer in 0 .. 1"):
        validate_index(index, 2)
    assert validate_index(1, 2) == 1


def test_the_origin_is_the_centre_of_the_bounding_box():
    assert survey_origin(TRIANGLE).tolist() == [20, 10]


def test_the_grid_covers_the_polygon_only():
    points, spacing_m = survey_grid(TRIANGLE, 1.0, 10000)
    x, y = points.T
    assert spacing_m == np.diff(np.unique(x)).min() == 1.0
    assert (x > 0).all() and (y > 0).all() and (x / 40 + y / 20 < 1).all()
    # Cell centres approximate the area to within half a cell along the boundary.
    assert abs(len(x) - 400) <= 0.5 * (40 + 20 + np.hypot(40, 20))


@pytest.mark.parametrize("resolution_m", [0.001, 0.1, 0.5])
def test_the_grid_is_coarsened_to_the_points_wanted(resolution_m):
    points, spacing_m = survey_grid(TRIANGLE, resolution_m, 1000)
    # One step of coarsening too many would leave about half of them.
    assert 600 <= len(points) <= 1000
    assert np.diff(np.unique(points[:, 0])).min() == pytest.approx(spacing_m)


def test_a_polygon_may_be_concave_and_run_either_way():
    corner = [[0, 0], [4, 0], [4, 2], [2, 2], [2, 4], [0, 4]]
    for area in (corner, corner[::-1]):
        assert len(survey_grid(area, 1.0, 100)[0]) == 12


@pytest.mark.parametrize("particles", [1, 2, 5, 7, 40, 100])
@pytest.mark.parametrize("nodes", [1, 2, 3, 4, 7])
def test_shares_cover_all_particles_and_differ_by_at_most_one(particles, nodes):
    shares = [share(particles, nodes, k) for k in range(nodes)]
    assert [j for part in shares for j in part] == list(range(particles))
    sizes = [len(part) for part in shares]
    assert max(sizes) - min(sizes) <= 1
    assert sizes == sorted(sizes, reverse=True)


def test_shares_are_those_of_the_shared_table():
    """The core computes them by itself: test/core/test_resampling.cpp reads the same file."""
    lines = [line for line in SHARES.read_text().splitlines() if not line.startswith("#")]
    assert len(lines) == 10
    for line in lines:
        size, nodes_of = line.split(":")
        particles, nodes = map(int, size.split())
        owned = [k for k in range(nodes) for _ in share(particles, nodes, k)]
        assert owned == list(map(int, nodes_of.split())), line
        assert owned == [owner(j, particles, nodes) for j in range(particles)]


def test_five_particles_on_two_nodes():
    assert [share(5, 2, 0), share(5, 2, 1)] == [range(0, 3), range(3, 5)]
