"""Normalised errors against values by hand, and against what their definition promises."""

import numpy as np
import pytest

from rbpf_svgp_slam.metrics.normalised_errors import nees, normalised_squares, symmetric


def poses_at(xy):
    """Poses [n, 6] at x, y [n, 2] m, the rest of them zero."""
    poses = np.zeros((len(xy), 6))
    poses[:, :2] = xy
    return poses


def upper(xx, xy, yy):
    """Upper triangles [1, 6] of x, y, yaw; what they say of the yaw must not count."""
    return np.array([[xx, xy, 0.3, yy, -0.2, 7.0]])


def test_upper_triangles_are_row_by_row():
    [matrix] = symmetric(np.array([[1.0, 2, 3, 4, 5, 6]]))
    np.testing.assert_array_equal(matrix, [[1, 2, 3], [2, 4, 5], [3, 5, 6]])


@pytest.mark.parametrize(
    "covariance, expected",
    [
        # S⁻¹ = diag(1/4, 1/9): (2²/4 + 3²/9) / 2
        (upper(4.0, 0.0, 9.0), 1.0),
        # det S = 4·9 − 3² = 27, S⁻¹ = [[9, −3], [−3, 4]] / 27: (9·4 − 2·3·6 + 4·9) / 27 / 2
        (upper(4.0, 3.0, 9.0), 36 / 27 / 2),
        # a hundredth of the first's: a hundred times as sure
        (upper(0.04, 0.0, 0.09), 100.0),
    ],
)
def test_nees_by_hand(covariance, expected):
    found, skipped = nees(poses_at([[12.0, 23.0]]), covariance, poses_at([[10.0, 20.0]]))
    assert found == pytest.approx(expected, rel=1e-12)
    assert skipped == 0


def test_a_covariance_that_is_none_is_left_out_and_counted():
    zero, rounding, line = upper(0, 0, 0), upper(1e-26, 0, 1e-26), upper(1.0, 1.0, 1.0)
    indefinite, good = upper(1.0, 2.0, 1.0), upper(1.0, 0.0, 1.0)
    unknown = np.full((1, 6), np.nan)
    covariances = np.concatenate([zero, rounding, line, indefinite, unknown, good])
    errors = poses_at(np.full((6, 2), 1.0))
    found, skipped = nees(errors, covariances, np.zeros((6, 6)))
    assert found == pytest.approx(1.0, rel=1e-12)
    assert skipped == 5
    assert nees(errors[:5], covariances[:5], np.zeros((5, 6))) == (None, 5)


def test_only_pings_with_ground_truth_count():
    truth = np.zeros((3, 6))
    truth[1] = np.nan
    covariances = np.concatenate([upper(1.0, 0, 1.0)] * 2 + [upper(0, 0, 0)])
    errors = poses_at([[1.0, 1.0], [50.0, 0.0], [1.0, 0.0]])
    assert nees(errors, covariances, truth) == (pytest.approx(1.0, rel=1e-12), 1)
    assert nees(errors, covariances, np.full((3, 6), np.nan)) == (None, None)


@pytest.mark.parametrize("claimed, expected", [(1.0, 1.0), (0.25, 4.0)])
def test_errors_drawn_from_the_covariance_give_one(claimed, expected):
    """And from four times the one that is claimed, four."""
    rng = np.random.default_rng(0)
    n = 20_000
    factors = rng.normal(0, 1, (n, 3, 3)) * [[2.0], [0.5], [0.01]]
    S = factors @ factors.transpose(0, 2, 1) + np.diag([0.1, 0.1, 1e-6])
    errors = (np.linalg.cholesky(S) @ rng.standard_normal((n, 3, 1)))[..., 0]
    poses = np.zeros((n, 6))
    poses[:, [0, 1, 5]] = errors
    rows = claimed * S[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
    found, skipped = nees(poses, rows, np.zeros((n, 6)))
    # χ² with 2n degrees of freedom over 2n: variance 1/n. Four standard errors are allowed.
    assert found == pytest.approx(expected, rel=4 / np.sqrt(n))
    assert skipped == 0
    squares = normalised_squares(errors, S)
    # χ² with 3 degrees of freedom has variance 6.
    assert squares.mean() == pytest.approx(3.0, abs=4 * np.sqrt(6 / n))
