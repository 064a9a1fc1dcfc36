"""Colours of point clouds: deep is dark blue, as in the report."""

import numpy as np
from sensor_msgs import point_cloud2
from std_msgs.msg import Header

from rbpf_svgp_slam.figures.cloud_colours import points_rgb, seabed_rgb
from rbpf_svgp_slam.protocol.clouds import packed_rgb, point_cloud

X, Y = np.arange(12.0), np.arange(9.0)


def test_deep_is_dark_and_blue():
    z = np.broadcast_to(np.linspace(-40.0, -20.0, 12)[:, None], (12, 9))
    rgb = seabed_rgb(X, Y, z).astype(int)
    assert rgb[0].sum(axis=-1).max() < rgb[-1].sum(axis=-1).min()
    assert (rgb[0, :, 2] > rgb[0, :, 0]).all()


def test_a_slope_towards_the_sun_is_brighter():
    """The sun stands in the north-west: a seabed that rises to the south-east faces it."""
    tilt = 0.2 * (X[:, None] - Y)
    bright, dark = seabed_rgb(X, Y, tilt), seabed_rgb(X, Y, -tilt)
    # the places in the middle are of one depth
    assert bright[4, 4].astype(int).sum() > dark[4, 4].astype(int).sum()


def test_holes_are_black_and_hide_nothing():
    z = np.random.default_rng(1).normal(-30.0, 1.0, (12, 9))
    z[3, 4] = np.nan
    rgb = seabed_rgb(X, Y, z)
    assert (rgb[3, 4] == 0).all()
    assert (rgb.reshape(-1, 3).sum(axis=1) > 0).sum() == z.size - 1


def test_points_have_the_colours_of_their_grid():
    z = np.random.default_rng(2).normal(-30.0, 1.0, (12, 9))
    z[2:4] = np.nan
    x, y = np.meshgrid(X, Y, indexing="ij")
    known = np.isfinite(z)
    points = np.column_stack([x[known], y[known], z[known]])
    order = np.random.default_rng(3).permutation(len(points))
    assert (points_rgb(points[order]) == seabed_rgb(X, Y, z)[known][order]).all()


def test_no_points_have_no_colours():
    assert points_rgb(np.empty((0, 3))).shape == (0, 3)


def test_a_cloud_carries_colours_bit_by_bit():
    rgb = np.array([[1, 2, 3], [255, 0, 128], [0, 0, 0]], dtype=np.uint8)
    cloud = point_cloud(Header(), {"x": np.arange(3), "rgb": packed_rgb(rgb)})
    read = [value for _, value in point_cloud2.read_points(cloud)]
    bits = np.array(read, dtype="<f4").view("<u4")
    assert bits.tolist() == [0x010203, 0xFF0080, 0]
