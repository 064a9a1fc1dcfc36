"""What of a grid has been surveyed."""

import numpy as np
import pytest
from sensor_msgs import point_cloud2
from std_msgs.msg import Header

from rbpf_svgp_slam.map_node.surveyed_seabed import SurveyedSeabed
from rbpf_svgp_slam.survey_area.grid import survey_grid

SIDE = 20
AREA = [[100, 0], [100 + 2 * SIDE, 0], [100 + 2 * SIDE, 2 * SIDE], [100, 2 * SIDE]]


@pytest.fixture
def seabed():
    """Of 20 x 20 cells of 2 m, as a map node has it."""
    return SurveyedSeabed(*survey_grid(AREA, 2.0, 1000))


def surveyed_by(seabed, *cells):
    """The grid [20, 20], with a beam in each of the cells (column, row)."""
    beams = [(100 + 2 * column + 1.3, 2 * row + 0.7, -20.0) for column, row in cells]
    seabed._on_beams(point_cloud2.create_cloud_xyz32(Header(frame_id="map"), beams))
    return seabed.surveyed().reshape(SIDE, SIDE)


def test_a_beam_surveys_its_cell_and_those_beside_it(seabed):
    expected = np.zeros((SIDE, SIDE), dtype=bool)
    expected[4:7, 9:12] = True
    np.testing.assert_array_equal(surveyed_by(seabed, (5, 10)), expected)


def test_at_the_edge_and_beyond_nothing_is_lost_or_wraps_round(seabed):
    expected = np.zeros((SIDE, SIDE), dtype=bool)
    expected[:2, :2] = expected[-2:, -2:] = True
    outside = [(-40, 5), (400, 5), (5, -40), (5, 400)]
    corners = [(0, 0), (SIDE - 1, SIDE - 1)]
    np.testing.assert_array_equal(surveyed_by(seabed, *corners, *outside), expected)


@pytest.mark.parametrize("apart, closed", [(7, True), (8, False)])
def test_only_what_lies_between_pings_of_a_line_is_filled(seabed, apart, closed):
    """Two swaths across the grid: of 6 cells between them each counts the one beside it anyway."""
    swaths = [(column, row) for column in (5, 5 + apart) for row in range(SIDE)]
    grid = surveyed_by(seabed, *swaths)
    assert grid[5 : 6 + apart, 3:-3].all() == closed  # the ends are rounded
    assert not grid[:4].any() and not grid[7 + apart :].any()


def test_an_area_without_points_has_nothing_surveyed():
    seabed = SurveyedSeabed(*survey_grid([[0, 0], [1, 0], [1, 1]], 10.0, 1000))
    seabed._on_beams(point_cloud2.create_cloud_xyz32(Header(), [(0.5, 0.5, -20.0)]))
    assert seabed.surveyed().shape == (0,)


def test_nothing_is_known_before_the_first_beam(seabed):
    seabed._on_beams(point_cloud2.create_cloud_xyz32(Header(), []))
    assert not seabed.known and not seabed.surveyed().any()
    assert surveyed_by(seabed, (3, 3)).any() and seabed.known
