"""Pings as drivers write them, and pings that hold nothing."""

from __future__ import annotations

import copy

import numpy as np
from geometry_msgs.msg import TransformStamped
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import LaserScan, PointCloud, PointCloud2
from tf2_msgs.msg import TFMessage

from bag_cases.clouds import beams, cloud, filled
from bag_cases.expected import RIGHT, Case, refused, stops
from bag_cases.survey import PINGS, TF_STATIC, Survey, each, spoil

#: As many beams as no simulated ping has.
FIXED_SIZE = 128
SCAN_FRAME = "mbes_scan"


def float64(survey: Survey) -> Survey:
    return each(survey, PINGS, lambda m, _: cloud(m, beams(m), "<f8"))


def big_endian(survey: Survey) -> Survey:
    return each(survey, PINGS, lambda m, _: cloud(m, beams(m), ">f4"))


def organised(survey: Survey) -> Survey:
    """Two rows and more fields than x y z."""
    return each(
        survey,
        PINGS,
        lambda m, _: cloud(m, filled(beams(m), FIXED_SIZE), extra_bytes=20, rows=2),
    )


def padded_rows(survey: Survey) -> Survey:
    return each(
        survey,
        PINGS,
        lambda m, _: cloud(m, filled(beams(m), FIXED_SIZE), extra_bytes=4, rows=2, row_padding=16),
    )


def mixed(survey: Survey) -> Survey:
    """float64, big-endian and padded in turn."""
    turn = 0

    def one_of(message: PointCloud2, _: float) -> PointCloud2:
        nonlocal turn
        turn += 1
        points = filled(beams(message), FIXED_SIZE)
        return cloud(
            message,
            points,
            dtype=("<f8", ">f4", "<f4")[turn % 3],
            rows=1 + turn % 2,
            row_padding=8 * (turn % 2),
        )

    return each(survey, PINGS, one_of)


def laser_scans(survey: Survey) -> Survey:
    """A fan of ranges at even angles, in a frame whose x axis looks down."""

    def scan(message: PointCloud2, _: float) -> LaserScan:
        points = beams(message)
        points = points[np.isfinite(points).all(axis=1)]
        down, left = -points[:, 2], points[:, 1]
        angle, range_m = np.arctan2(left, down), np.hypot(left, down)
        order = np.argsort(angle)
        even = np.linspace(angle.min(), angle.max(), len(angle))
        out = LaserScan(header=copy.deepcopy(message.header), range_min=0.5, range_max=100.0)
        out.header.frame_id = SCAN_FRAME
        out.angle_min, out.angle_max = even[0], even[-1]
        out.angle_increment = even[1] - even[0]
        out.ranges = np.interp(even, angle[order], range_m[order]).tolist()
        return out

    def with_scanner(message: TFMessage, _: float) -> TFMessage:
        looks_down = TransformStamped(header=copy.deepcopy(message.transforms[0].header))
        looks_down.header.frame_id, looks_down.child_frame_id = "mbes", SCAN_FRAME
        columns = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]).T
        q = looks_down.transform.rotation
        q.x, q.y, q.z, q.w = Rotation.from_matrix(columns).as_quat().tolist()
        return TFMessage([*message.transforms, looks_down])

    return each(each(survey, PINGS, scan), TF_STATIC, with_scanner)


def no_bottom_lock(survey: Survey) -> Survey:
    """While it dives: all ranges zero, then clouds without points or fields."""
    survey = spoil(survey, PINGS, range(30), lambda m: cloud(m, 0 * beams(m)))
    return spoil(survey, PINGS, range(30, 60), lambda m: PointCloud2(header=m.header))


def some_all_nan(survey: Survey) -> Survey:
    return spoil(survey, PINGS, range(90, 100), lambda m: cloud(m, np.nan * beams(m)))


def some_cut_off(survey: Survey) -> Survey:
    """Fewer bytes than the sizes say, and a cloud without z."""

    def cut(message: PointCloud2) -> PointCloud2:
        message.data = message.data[:100]
        return message

    def flat(message: PointCloud2) -> PointCloud2:
        message.fields = message.fields[:2]
        return message

    return spoil(spoil(survey, PINGS, range(90, 95), cut), PINGS, range(95, 100), flat)


def of_another_type(survey: Survey) -> Survey:
    """The older sensor_msgs/PointCloud, which nobody reads."""
    return each(survey, PINGS, lambda m, _: PointCloud(header=m.header))


CASES = [
    Case("float64", "formats", "x y z of float64", float64, RIGHT),
    Case("big_endian", "formats", "big-endian numbers", big_endian, RIGHT),
    Case("organised", "formats", "two rows, more fields", organised, RIGHT),
    Case("padded_rows", "formats", "padding after each row", padded_rows, RIGHT),
    Case("laser_scans", "formats", "pings as LaserScan", laser_scans, RIGHT),
    Case(
        "no_bottom_lock",
        "formats",
        "30 pings of zeros, 30 without points",
        no_bottom_lock,
        refused("pings/no_beams", "pings/malformed"),
    ),
    Case("pings_all_nan", "formats", "10 pings of NaN", some_all_nan, refused("pings/no_beams")),
    Case(
        "pings_cut_off",
        "formats",
        "5 pings cut off, 5 without z",
        some_cut_off,
        refused("pings/malformed"),
    ),
    Case(
        "pings_of_another_type",
        "formats",
        "pings as sensor_msgs/PointCloud",
        of_another_type,
        stops(r"sensor_msgs/PointCloud\b", "sensor_msgs/PointCloud2"),
    ),
]
