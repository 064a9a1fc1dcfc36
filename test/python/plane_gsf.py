"""Writes data/plane.gsf with libgsf 3.09, to hold our reader against: python3 plane_gsf.py.

Needs gsfpy 2.0.0 (PyPI), which brings libgsf for x86-64, and pyproj. A vehicle goes 2 m/s from
60° N, 20° E on a heading of 30°, with a ping each 0.2 s; the seabed's depth is
20 + 0.1 east - 0.05 north. Rejected are each ping's fourth beam, which is off the seabed, and the
eighth ping. Depths and distances across have four bytes in mm, from the eleventh ping on two bytes
in cm with an offset.
"""

from ctypes import byref, c_char, c_double, c_int, c_ubyte, cast
from pathlib import Path

import numpy as np
from gsfpy3_09 import bindings, open_gsf
from gsfpy3_09.enums import FileMode, RecordType
from gsfpy3_09.gsfDataID import c_gsfDataID
from gsfpy3_09.gsfRecords import c_gsfRecords
from gsfpy3_09.timespec import c_timespec
from pyproj import Transformer

START_S, PINGS, PERIOD_NS = 1_700_000_000, 20, 200_000_000
HEADING_DEG, SPEED_MPS = 30.0, 2.0
ACROSS_M = np.array([-30.0, -20.0, -10.0, 0.0, 10.0, 20.0, 30.0])
ALONG_M = np.array([-0.3, -0.2, -0.1, 0.0, 0.1, 0.2, 0.6])
FLAGS = [0, 2, 0, 1, 0, 4, 0]
PLANE = "+proj=ortho +lat_0=60 +lon_0=20 +ellps=WGS84"


def main():
    file = open_gsf(Path(__file__).parent / "data" / "plane.gsf", FileMode.GSF_CREATE)
    scales = c_gsfRecords().mb_ping.scaleFactors
    for number in range(PINGS):
        record, arrays = ping(number)
        if number in (0, 10):
            scales = scale_factors(fine=number == 0)
        record.mb_ping.scaleFactors = scales
        write(file, record, RecordType.GSF_RECORD_SWATH_BATHYMETRY_PING, number in (0, 19))
    record, arrays = attitudes()
    write(file, record, RecordType.GSF_RECORD_ATTITUDE)
    file.close()


def write(file, record, kind, checksum=False):
    name = c_gsfDataID(checksumFlag=checksum, recordID=kind)
    if bindings.gsfWrite(file._handle, byref(name), byref(record)) < 0:
        raise RuntimeError(bindings.gsfStringError())


def moment(number):
    return c_timespec(START_S + number * PERIOD_NS // 10**9, number * PERIOD_NS % 10**9)


def array(numbers, kind=c_double):
    return (kind * len(numbers))(*numbers)


def ping(number):
    """A record, and the arrays that it points to."""
    s, c = np.sin(np.radians(HEADING_DEG)), np.cos(np.radians(HEADING_DEG))
    forward_m = 1e-9 * SPEED_MPS * number * PERIOD_NS + ALONG_M
    east_m, north_m = forward_m * s + ACROSS_M * c, forward_m * c - ACROSS_M * s
    depth_m = 20 + 0.1 * east_m - 0.05 * north_m
    depth_m[3] = 3.0
    record = c_gsfRecords()
    p = record.mb_ping
    p.ping_time = moment(number)
    to_degrees = Transformer.from_crs(PLANE, "EPSG:4326", always_xy=True)
    centre_m = 1e-9 * SPEED_MPS * number * PERIOD_NS
    # gsfpy 2.0.0 has the two in the other order than libgsf's structure
    p.latitude, p.longitude = to_degrees.transform(centre_m * s, centre_m * c)
    p.number_beams, p.center_beam, p.ping_flags = len(ACROSS_M), 3, int(number == 7)
    p.depth_corrector, p.tide_corrector = 1.25, -0.5
    p.heading, p.pitch, p.roll, p.heave = HEADING_DEG, -1.5, 0.1 * number, 0.2
    arrays = {
        "depth": array(depth_m),
        "across_track": array(ACROSS_M),
        "along_track": array(ALONG_M),
        "travel_time": array(np.full(len(ACROSS_M), 0.03)),
        "beam_flags": array(FLAGS, c_ubyte),
    }
    for name, numbers in arrays.items():
        setattr(p, name, cast(numbers, dict(p._fields_)[name]))
    return record, arrays


def scale_factors(fine):
    scales = c_gsfRecords().mb_ping.scaleFactors
    wide, step_m, offset_m = (0x40, 0.001, 0) if fine else (0x20, 0.01, -2)
    for part, form, step, offset in (
        (1, wide, step_m, offset_m),
        (2, wide, step_m, 0),
        (3, 0x10, 0.1, 0),
        (4, 0x20, 1e-5, 0),
        (16, 0x10, 1.0, 0),
    ):
        bindings._libgsf.gsfLoadScaleFactor(
            byref(scales), c_int(part), c_char(form), c_double(step), c_int(offset)
        )
    return scales


def attitudes():
    """A record, and the arrays that it points to."""
    numbers = range(PINGS + 1)
    record = c_gsfRecords()
    record.attitude.num_measurements = len(numbers)
    arrays = {
        "attitude_time": (c_timespec * len(numbers))(*map(moment, numbers)),
        "pitch": array([-1.5 for _ in numbers]),
        "roll": array([0.1 * number for number in numbers]),
        "heave": array([0.2 for _ in numbers]),
        "heading": array([0.0 for _ in numbers]),
    }
    for name, values in arrays.items():
        setattr(record.attitude, name, cast(values, dict(record.attitude._fields_)[name]))
    return record, arrays


if __name__ == "__main__":
    main()
