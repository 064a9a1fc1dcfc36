"""The map as an occupancy grid."""

import numpy as np
from std_msgs.msg import Header

from rbpf_svgp_slam.map_node.depth_rank import UNKNOWN, depth_ranks, occupancy_grid
from rbpf_svgp_slam.survey_area.grid import survey_grid


def test_ranks_go_from_the_shallowest_to_the_deepest_of_what_is_surveyed():
    z = np.array([-30.0, -10.0, -20.0, -5.0, -100.0])
    surveyed = np.array([True, True, True, False, True])
    np.testing.assert_array_equal(depth_ranks(z, surveyed), [67, 0, 33, UNKNOWN, 100])


def test_where_nothing_is_surveyed_there_is_no_rank():
    z = np.full(3, -20.0)
    np.testing.assert_array_equal(depth_ranks(z, np.zeros(3, bool)), [UNKNOWN] * 3)
    np.testing.assert_array_equal(depth_ranks(z, np.array([False, True, False])), [-1, 0, -1])


def test_cells_lie_where_their_points_do():
    triangle = [[100.0, 0.0], [140.0, 0.0], [100.0, 30.0]]
    points, _ = survey_grid(triangle, 2.0, 10000)
    ranks = np.arange(len(points)) % 101
    grid = occupancy_grid(Header(frame_id="map"), points, ranks, 2.0)
    assert grid.header.frame_id == "map"
    assert (grid.info.resolution, grid.info.width, grid.info.height) == (2.0, 19, 15)
    cells = np.array(grid.data).reshape(grid.info.height, grid.info.width)
    corner = grid.info.origin.position
    for (x, y), rank in zip(points, ranks):
        # a cell's centre, as nav_msgs has it: row by row, x runs fastest
        column = (x - corner.x) / grid.info.resolution - 0.5
        row = (y - corner.y) / grid.info.resolution - 0.5
        assert cells[round(row), round(column)] == rank
        assert abs(column - round(column)) < 1e-9 and abs(row - round(row)) < 1e-9
    assert (cells == UNKNOWN).sum() == cells.size - len(points)


def test_a_single_point_is_a_cell_of_the_resolution():
    grid = occupancy_grid(Header(), np.array([[3.0, 4.0]]), np.array([0]), 0.5)
    assert (grid.info.resolution, list(grid.data)) == (0.5, [0])
    assert (grid.info.origin.position.x, grid.info.origin.position.y) == (2.75, 3.75)
