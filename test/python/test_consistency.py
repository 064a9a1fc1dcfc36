"""Roman and Singh's consistency of the passes against closed forms and brute force."""

import itertools

import numpy as np
import pytest
from made_up_survey import ROUNDING_M, lawn_mower

from rbpf_svgp_slam.metrics import cells
from rbpf_svgp_slam.metrics.consistency import (
    ConsistencySettings,
    consistency,
    farthest_pass_distance,
    split_passes,
    survey_lines,
)


def two_planes(dz_m):
    x, y = np.meshgrid(np.arange(0.25, 20, 0.5), np.arange(0.25, 10, 0.5))
    plane = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, -30.0)])
    passes = np.repeat([0, 1], len(plane))
    return np.vstack([plane, plane + [0, 0, dz_m]]), passes


@pytest.mark.parametrize("dz_m", [0.4, -2.5])
def test_consistency_of_two_planes_is_their_distance(dz_m):
    points, passes = two_planes(dz_m)
    result = consistency(points, passes, ConsistencySettings(), np.random.default_rng(0))
    assert result.rms_m == pytest.approx(abs(dz_m), abs=ROUNDING_M)
    assert len(result.error_m) == 200
    assert result.points_per_cell_and_pass == 4


def test_consistency_ignores_cells_above_which_nothing_disagrees():
    points, passes = two_planes(0.0)
    result = consistency(points, passes, ConsistencySettings(), np.random.default_rng(0))
    assert result.rms_m is None and len(result.error_m) == 0


def brute_force(points, passes, resolution_m):
    """Per cell, per pass: the farthest-pass distances [2] of its points, by the definition."""
    cell_of = [tuple(np.floor(point[:2] / resolution_m).astype(int)) for point in points]
    result = {}
    for point, own, (i, j) in zip(points, passes, cell_of):
        nearest, in_cell = {}, {other for other, c in zip(passes, cell_of) if c == (i, j)}
        for other_point, other, (k, m) in zip(points, passes, cell_of):
            if other != own and abs(i - k) <= 1 and abs(j - m) <= 1:
                distance = np.linalg.norm(point - other_point)
                nearest[other] = min(distance, nearest.get(other, np.inf))
        group = result.setdefault((i, j), {}).setdefault(own, [])
        overlap = (nearest[other] for other in nearest if other in in_cell)
        group.append([max(nearest.values(), default=0.0), max(overlap, default=0.0)])
    return result


def scattered(rng, n=250):
    """Points of four passes, steep enough that nearest points lie beyond the 3 × 3 cells."""
    points = rng.uniform([-5, -4, -3], [5, 4, 3], (n, 3))
    return points, rng.integers(0, 4, n)


def test_farthest_pass_distance_equals_brute_force():
    points, passes = scattered(np.random.default_rng(3))
    keys = cells.cell_keys(points[:, :2], 1.0)
    order = np.argsort(keys, kind="stable")
    points, passes, keys = points[order], passes[order], keys[order]
    cell_key, cell = np.unique(keys, return_inverse=True)
    ours = farthest_pass_distance(points, passes, cell_key, cell, np.arange(len(points)))
    some = np.array([7, 3, 200])
    np.testing.assert_array_equal(
        farthest_pass_distance(points, passes, cell_key, cell, some), ours[some]
    )
    expected = brute_force(points, passes, 1.0)
    for centre, c in zip(cells.cell_centres(cell_key, 1.0), range(len(cell_key))):
        for number, distances in expected[tuple(np.floor(centre).astype(int))].items():
            mine = ours[(cell == c) & (passes == number)]
            np.testing.assert_allclose(mine, distances, atol=ROUNDING_M)


def test_consistency_draws_have_the_mean_of_brute_force():
    points, passes = scattered(np.random.default_rng(4), n=120)
    drawn = ConsistencySettings(draws=4000)
    result = consistency(points, passes, drawn, np.random.default_rng(0))
    ours = {tuple(np.floor(c).astype(int)): e for c, e in zip(result.centre_m, result.error_m)}
    expected = []
    for cell, groups in brute_force(points, passes, 1.0).items():
        largest = np.max(list(itertools.product(*groups.values())), axis=1)
        expected.append(largest.mean(axis=0))
        # Five standard errors of the mean of 4000 draws: one failure in a million cells.
        tolerance = 5 * largest[:, 1].std() / np.sqrt(drawn.draws) + ROUNDING_M
        assert ours.get(cell, 0.0) == pytest.approx(expected[-1][1], abs=tolerance)
    expected = np.ma.masked_equal(expected, 0.0)
    rms = np.sqrt((expected**2).mean(axis=0))
    # The RMS averages about 80 cells, each off by at most 5·0.5 m/√4000 = 0.04 m as above.
    np.testing.assert_allclose([result.rms_m, result.overlap_rms_m], rms, atol=0.01)


def test_consistency_is_thinned_as_the_settings_say():
    points, passes = two_planes(1.0)
    few = ConsistencySettings(max_points_per_cell=2)
    result = consistency(points, passes, few, np.random.default_rng(0))
    assert result.points_per_cell_and_pass == 2
    # The nearest of the other plane is at least dz away, and at most two diagonals of the cell.
    assert 1.0 <= result.rms_m <= 3.0
    fewer = ConsistencySettings(max_beams=100)
    result = consistency(points, passes, fewer, np.random.default_rng(0))
    assert result.points_per_cell_and_pass < 2


def test_passes_are_the_lines_of_a_lawn_mower_with_their_turns():
    poses = lawn_mower(lines=6)
    wobble = np.deg2rad(10) * np.sin(np.arange(len(poses)))
    passes = split_passes(poses[:, 5] + wobble)
    assert passes.max() == 5
    # In the middle of every line, away from the turns, the pass is the line.
    on_line = (poses[:, 0] > 5) & (poses[:, 0] < 95)
    np.testing.assert_array_equal(passes[on_line], np.round(poses[on_line, 1] / 10))


def test_a_survey_without_turns_is_one_line_and_is_cut_into_chunks():
    assert not survey_lines(np.zeros(20)).any()
    np.testing.assert_array_equal(split_passes(np.zeros(20)), np.repeat(np.arange(10), 2))
    assert split_passes(np.empty(0)).shape == (0,)
