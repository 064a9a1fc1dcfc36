"""Whole simulated surveys: their random numbers, and one over a real seabed."""

import pathlib

import numpy as np
import pytest
from small_survey import CAST_TOLERANCE_M, QUIET, beams_in_map

from rbpf_svgp_slam.simulation.mission import get_mission
from rbpf_svgp_slam.simulation.simulation import simulate_survey

REAL_SEABED = pathlib.Path(__file__).resolve().parents[3] / "shared/data/block_b_1m.npz"


def test_the_seed_decides_and_the_streams_are_separate():
    mission = get_mission("demo", 0.1)

    def run(seed, **options):
        return simulate_survey(mission, seed, max_duration_s=20, **options)

    one, same, other, quiet = run(1), run(1), run(2), run(1, noise=QUIET)
    pairs = zip(one.pings.points_m, same.pings.points_m)
    assert all(np.array_equal(a, b, equal_nan=True) for a, b in pairs)
    assert np.array_equal(one.odometry.linear_mps, same.odometry.linear_mps)
    assert not np.array_equal(one.odometry.linear_mps, other.odometry.linear_mps)
    assert not np.array_equal(one.terrain.z_m, other.terrain.z_m)
    assert np.array_equal(one.odometry.linear_mps, quiet.odometry.linear_mps)
    assert np.array_equal(one.terrain.z_m, quiet.terrain.z_m)


@pytest.mark.skipif(not REAL_SEABED.exists(), reason=f"no real seabed at {REAL_SEABED}")
def test_lolo3_over_a_real_seabed():
    mission = get_mission("lolo3")
    survey = simulate_survey(mission, 1, REAL_SEABED, QUIET, max_duration_s=200)
    x, y, z = beams_in_map(survey.pings, survey.truth).T
    np.testing.assert_allclose(z, survey.terrain.height_m(x, y), atol=2 * CAST_TOLERANCE_M)
    assert survey.terrain.contains(*survey.truth.position_m[:, :2].T).all()
