"""The inducing points' first positions."""

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

from rbpf_svgp_slam.svgp.inducing import grid_pitch_m, initial_inducing_points


def rotated(vertices, angle_rad):
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.asarray(vertices) @ np.array([[c, s], [-s, c]])


RECTANGLE = [[-100.0, -75.0], [100.0, -75.0], [100.0, 75.0], [-100.0, 75.0]]
ELL = [[0.0, 0.0], [300.0, 0.0], [300.0, 60.0], [80.0, 60.0], [80.0, 200.0], [0.0, 200.0]]
TRIANGLE = [[0.0, 0.0], [100.0, 20.0], [30.0, 90.0]]
AREAS = {
    "rectangle": RECTANGLE,
    "clockwise": RECTANGLE[::-1],
    "rotated": rotated(RECTANGLE, 0.7),
    "not convex": ELL,
    "triangle": TRIANGLE,
    "far from the origin": np.array(ELL) + [4e5, -6e6],
}


def inside(points, vertices):
    """Winding number, an algorithm of its own."""
    angles = np.zeros(len(points))
    vertices = np.asarray(vertices, dtype=float)
    for start, end in zip(vertices, np.roll(vertices, -1, axis=0)):
        a, b = (start - points).T, (end - points).T
        angles += np.arctan2(a[0] * b[1] - a[1] * b[0], (a * b).sum(axis=0))
    return np.abs(angles) > math.pi


@pytest.mark.parametrize("count", [400, 397, 150])
@pytest.mark.parametrize("name", AREAS)
def test_exactly_the_count_on_one_grid_inside(name, count):
    area = AREAS[name]
    Z = initial_inducing_points(area, count)
    assert Z.shape == (count, 2)
    assert inside(Z, area).all()
    # Neighbours at the pitch of an ideal grid, which may be up to a quarter from square
    nearest = cKDTree(Z).query(Z, k=2)[0][:, 1]
    assert np.quantile(nearest, 0.9) < 1.001 * nearest.min()
    assert nearest.min() == pytest.approx(grid_pitch_m(area, count), rel=0.2)
    # No hole: from any place inside the next point is not far
    rng = np.random.default_rng(0)
    low, high = np.min(area, axis=0), np.max(area, axis=0)
    places = rng.uniform(low, high, (3000, 2))
    gaps = cKDTree(Z).query(places[inside(places, area)])[0]
    assert np.quantile(gaps, 0.98) < grid_pitch_m(area, count)


def test_grid_has_the_aspect_ratio_of_the_area():
    Z = initial_inducing_points(RECTANGLE, 400)
    columns, rows = (len(np.unique(Z[:, i].round(6))) for i in range(2))
    assert columns / rows == pytest.approx(200.0 / 150.0, rel=0.1)
    np.testing.assert_allclose(Z.mean(axis=0), 0.0, atol=2.0)


def test_grid_follows_the_sides_of_the_area():
    upright = initial_inducing_points(RECTANGLE, 100)
    turned = initial_inducing_points(rotated(RECTANGLE, 0.7), 100)
    back = rotated(turned, -0.7)
    assert cKDTree(back).query(upright)[0].max() < 1e-9


@pytest.mark.parametrize("count", [1, 2, 7])
@pytest.mark.parametrize("name", AREAS)
def test_few_points(name, count):
    assert inside(initial_inducing_points(AREAS[name], count), AREAS[name]).all()


def test_a_strip_narrower_than_the_pitch():
    Z = initial_inducing_points([[0.0, 0.0], [1000.0, 0.0], [1000.0, 0.4], [0.0, 0.4]], 150)
    assert Z.shape == (150, 2)
    assert np.diff(np.sort(Z[:, 0])).max() < 20.0


@pytest.mark.parametrize(
    "area, message",
    [
        ([[0.0, 0.0], [1.0, 0.0]], r"shape \(2, 2\)"),
        ([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]], "encloses 0 m2"),
        ([[1.0, 1.0]] * 4, "encloses 0 m2"),
        ([[0.0, 0.0], [1.0, math.nan], [2.0, 0.0]], "expected finite"),
    ],
)
def test_areas_without_inside_are_refused(area, message):
    with pytest.raises(ValueError, match=message):
        initial_inducing_points(area, 10)
