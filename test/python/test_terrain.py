"""Seabeds of the simulator: generated, and from a file."""

import numpy as np
import pytest
from small_survey import generated, plane

from rbpf_svgp_slam.simulation import SurveyError
from rbpf_svgp_slam.simulation.mission import MISSIONS
from rbpf_svgp_slam.simulation.terrain import load_terrain, save_terrain


def test_bilinear_height_is_exact_on_a_plane_and_nan_off_the_grid():
    terrain = plane(0.1, -0.2, resolution_m=0.5)
    x_m, y_m = np.random.default_rng(0).uniform(-100, 100, (2, 1000))
    expected_m = -30 + 0.1 * x_m - 0.2 * y_m
    # float32 nodes of up to 60 m are rounded by 2e-6 m.
    np.testing.assert_allclose(terrain.height_m(x_m, y_m), expected_m, atol=1e-5)
    off = terrain.height_m(np.array([-100.01, 0.0, 100.01]), np.array([0.0, 100.01, 0.0]))
    assert np.isnan(off).all()


def test_generated_terrain_has_relief_and_depends_on_the_seed():
    mission = MISSIONS["demo"]
    one, same, other = generated(mission, 1), generated(mission, 1), generated(mission, 2)
    assert np.array_equal(one.z_m, same.z_m)
    assert not np.array_equal(one.z_m, other.z_m)
    assert 5 < np.ptp(one.z_m) < 20
    assert one.contains(*(-mission.margin_m * np.ones(2)))
    assert one.contains(*(np.array(mission.area_m) + mission.margin_m))


def test_terrain_file_round_trip_and_default_placement(tmp_path):
    terrain = plane(0.1)
    save_terrain(tmp_path / "t.npz", terrain)
    loaded = load_terrain(tmp_path / "t.npz", centre_m=(7.0, 7.0))
    assert np.array_equal(loaded.z_m, terrain.z_m)
    assert np.array_equal(loaded.origin_m, terrain.origin_m)
    np.savez(tmp_path / "unplaced.npz", z=terrain.z_m, resolution_m=1.0)
    unplaced = load_terrain(tmp_path / "unplaced.npz", centre_m=(7.0, 9.0))
    np.testing.assert_allclose(0.5 * (unplaced.origin_m + unplaced.upper_m), [7.0, 9.0])


@pytest.mark.parametrize(
    "arrays, message",
    [
        ({"resolution_m": 1.0}, "'z' is missing"),
        ({"z": np.zeros((9, 9))}, "'resolution_m' is missing"),
        ({"z": np.zeros(9), "resolution_m": 1.0}, r"\(9,\), expected"),
        ({"z": np.full((9, 9), np.nan), "resolution_m": 1.0}, "no finite value"),
        ({"z": np.zeros((9, 9)), "resolution_m": -1.0}, "resolution_m is -1.0, expected"),
        ({"z": np.zeros((9, 9)), "resolution_m": 1.0, "origin_m": [0.0]}, "origin_m is"),
    ],
)
def test_terrain_file_mistakes_are_named(tmp_path, arrays, message):
    np.savez(tmp_path / "t.npz", **arrays)
    with pytest.raises(SurveyError, match=message):
        load_terrain(tmp_path / "t.npz", (0, 0))
