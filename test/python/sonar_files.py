"""Small files of sonars for the tests, packed here: a flat seabed under a straight line.

The vehicle goes north at SPEED_MPS, level, with its sonar DOWN_M below the reference point; the
seabed is DEPTH_M below that. Times are seconds since START_S.
"""

import datetime
import struct
from pathlib import Path

import numpy as np

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data"
START_S = 1_700_000_000
SPEED_MPS, DOWN_M, DEPTH_M, SOUND_MPS = 2.0, 1.0, 20.0, 1500.0
LATITUDE_DEG, LONGITUDE_DEG = 60.0, 20.0
METRES_PER_DEGREE = 111_412.0  # of latitude, at 60°
ANGLES_RAD = np.radians(np.linspace(-60.0, 60.0, 31))  # to starboard


def latitude_deg(time_s):
    return LATITUDE_DEG + SPEED_MPS * time_s / METRES_PER_DEGREE


def travel_times_s():
    """Of each beam, down to the seabed and back."""
    return 2 * (DEPTH_M - DOWN_M) / np.cos(ANGLES_RAD) / SOUND_MPS


# R2Sonic in XTF


def xtf(seconds=10.0, begin_s=0.0, roll_deg=0.0):
    """A whole file: packets of positions and attitudes at 10 Hz, pings at 5 Hz."""
    parts = [xtf_header(roll_deg)]
    for k in range(int(10 * seconds) + 1):
        time_s = begin_s + 0.1 * k
        parts += [xtf_position(time_s), xtf_attitude(time_s)]
        if k % 2 == 1:
            parts.append(xtf_ping(time_s - 0.03, roll_deg))
    return b"".join(parts)


def xtf_header(roll_deg=0.0):
    data = bytearray(1024)
    data[0] = 123
    struct.pack_into("<3H", data, 164, 3, 0, 1)  # latitude and longitude; one bathymetry channel
    data[256] = 3  # the first channel, bathymetry: X to starboard, Y forward, Z down
    struct.pack_into("<6f", data, 256 + 48, 0.0, 0.0, DOWN_M, 0.0, 0.0, roll_deg)
    return bytes(data)


def xtf_packet(kind, body):
    size = -(-(14 + len(body)) // 64) * 64
    return (struct.pack("<HBBHII", 0xFACE, kind, 0, 1, 0, size) + body).ljust(size, b"\0")


def date_of(time_s):
    """Year to second, and microseconds."""
    moment = datetime.datetime.fromtimestamp(START_S + time_s, datetime.timezone.utc)
    return moment.timetuple()[:6], moment.microsecond


def xtf_position(time_s):
    date, microseconds = date_of(time_s)
    body = struct.pack("<H5BH", *date, round(microseconds / 100))
    return xtf_packet(107, body + struct.pack("<2d", latitude_deg(time_s), LONGITUDE_DEG))


def xtf_attitude(time_s):
    date, microseconds = date_of(time_s)
    body = struct.pack("<4I4fIf", 0, 0, 0, 0, 0.0, 0.0, 0.0, 0.0, 0, 0.0)
    return xtf_packet(3, body + struct.pack("<H5BH", *date, round(microseconds / 1000)))


def xtf_ping(time_s, roll_deg=0.0):
    return xtf_packet(65, bytes(256 - 14) + r2sonic(time_s, roll_deg))


def r2sonic(time_s, roll_deg=0.0):
    """The packet BTH0; an array that is mounted with a roll sees the same beams by other angles."""
    beams = len(ANGLES_RAD)
    stamp_s, nanoseconds = divmod(round(1e9 * (START_S + time_s)), 1_000_000_000)
    header = struct.pack(
        ">12s12s3I9fHh7fI2H",
        *(b"2026", b"1", stamp_s, nanoseconds, 1, 0.2, SOUND_MPS, *[0.0] * 7),
        *(0, 0, *[0.0] * 7, 0, 0, beams),
    )
    scale_s = 1e-6
    ranges = np.round(travel_times_s() / scale_s).astype(">u2")
    angles_rad = ANGLES_RAD + np.radians(roll_deg)
    steps = np.round(np.diff(angles_rad, prepend=angles_rad[0]) / 1e-5).astype(">u2")
    pad = b"\0\0" * (beams % 2)
    quality = np.full((beams + 1) // 2, 0x77, np.uint8)  # all good
    sections = (
        section(b"H0", header),
        section(b"R0", struct.pack(">f", scale_s) + ranges.tobytes() + pad),
        section(b"A2", struct.pack(">8f", angles_rad[0], 1e-5, *[0.0] * 6) + steps.tobytes() + pad),
        section(b"Q0", quality.tobytes()),
    )
    body = b"".join(sections)
    return struct.pack(">4s2I", b"BTH0", 12 + len(body), 0) + body


def section(name, body):
    return struct.pack(">2sH", name, 4 + len(body)) + body


# Kongsberg's .kmall


def kmall(seconds=4.0):
    """Installation, profile, one #SKM at 50 Hz, pings at 5 Hz."""
    text = f"EMXV:EM2040,TRAI_HD1:X=0;Y=0;Z={DOWN_M};R=0;P=0;H=0,ATTI_1:X=0;Y=0;Z=0;R=0;P=0;H=0,"
    text = text.encode()
    parts = [
        kmall_datagram(b"#IIP", 0.0, struct.pack("<3H", 6 + len(text), 0, 0) + text),
        kmall_datagram(b"#SVP", 0.0, kmall_profile()),
        kmall_datagram(b"#SKM", 0.0, kmall_attitudes(0.02 * np.arange(int(50 * seconds) + 1))),
    ]
    times_s = 0.2 * np.arange(int(5 * seconds) + 1)
    return b"".join(parts + [kmall_datagram(b"#MRZ", t, kmall_ping(t)) for t in times_s])


def kmall_datagram(kind, time_s, body):
    size = 20 + len(body) + 4
    stamp_s, nanoseconds = divmod(round(1e9 * (START_S + time_s)), 1_000_000_000)
    header = struct.pack("<I4s2BH2I", size, kind, 0, 0, 2040, stamp_s, nanoseconds)
    return header + body + struct.pack("<I", size)


def kmall_profile():
    points = [struct.pack("<fffff", depth_m, SOUND_MPS, 0, 0, 0) for depth_m in (0.0, 100.0)]
    return struct.pack("<2H4sI2d", 28, 2, b"S01", 0, 0.0, 0.0) + b"".join(points)


def kmall_attitudes(times_s):
    samples = []
    for time_s in times_s:
        sample = bytearray(132)
        stamp_s, nanoseconds = divmod(round(1e9 * (START_S + time_s)), 1_000_000_000)
        struct.pack_into("<2I", sample, 8, stamp_s, nanoseconds)
        samples.append(bytes(sample))
    return struct.pack("<H2B4H", 12, 0, 0, 0, len(samples), 132, 0) + b"".join(samples)


def kmall_ping(time_s, receivers=1, sector=0):
    info = bytearray(144)
    struct.pack_into("<H", info, 0, len(info))
    struct.pack_into("<2H", info, 92, 1, 36)
    struct.pack_into("<f", info, 100, SOUND_MPS)
    struct.pack_into("<2d", info, 124, latitude_deg(time_s), LONGITUDE_DEG)
    beams = []
    for number, (angle_rad, travel_time_s) in enumerate(zip(ANGLES_RAD, travel_times_s())):
        beam = bytearray(120)
        struct.pack_into("<H2B", beam, 0, number, sector, 0)
        # positive to port
        struct.pack_into("<4f", beam, 72, -np.degrees(angle_rad), 0.0, travel_time_s, 0.0)
        beams.append(bytes(beam))
    common = struct.pack("<2H8B", 12, 0, 1, 0, 1, 0, 0, 0, receivers, 0)
    receiver = struct.pack("<4H4f4H", 32, len(beams), len(beams), 120, *[0.0] * 4, 0, 0, 0, 0)
    return struct.pack("<2H", 1, 1) + common + bytes(info) + bytes(36) + receiver + b"".join(beams)


# Kongsberg's .all


def all_(seconds=4.0):
    """Installation, profile, one A at 50 Hz, positions at 1 Hz, pings at 5 Hz."""
    text = f"WLZ=0,S1X=0,S1Y=0,S1Z={DOWN_M},S2X=0,S2Y=0,S2Z={DOWN_M},".encode()
    profile = struct.pack("<2I2H4I", 20231114, 0, 2, 100, 0, 15000, 100, 15000)
    parts = [
        all_datagram(b"I", 0.0, b"\0\0" + text),
        all_datagram(b"U", 0.0, profile + b"\0"),
        all_datagram(b"A", 0.0, all_attitudes(int(50 * seconds) + 1)),
    ]
    parts += [all_datagram(b"P", float(t), all_position(t)) for t in range(int(seconds) + 1)]
    times_s = 0.2 * np.arange(int(5 * seconds) + 1)
    return b"".join(parts + [all_datagram(b"N", t, all_ping()) for t in times_s])


def all_datagram(kind, time_s, body):
    (year, month, day, hour, minute, second), microseconds = date_of(time_s)
    date = 10000 * year + 100 * month + day
    milliseconds = 1000 * (3600 * hour + 60 * minute + second) + round(microseconds / 1000)
    body = struct.pack("<2cH2I2H", b"\2", kind, 710, date, milliseconds, 1, 229) + body + b"\3\0\0"
    return struct.pack("<I", len(body)) + body


def all_attitudes(count):
    samples = [struct.pack("<2H3hH", 20 * k, 0, 0, 0, 0, 0) for k in range(count)]
    return struct.pack("<H", count) + b"".join(samples) + b"\0"


def all_position(time_s):
    place = (round(2e7 * latitude_deg(time_s)), round(1e7 * LONGITUDE_DEG))
    return struct.pack("<2i4H2B", *place, 0, 0, 0, 0, 1, 0)


def all_ping(sector=0):
    beams = [
        struct.pack("<h2BH2BfhBB", round(-100 * np.degrees(a)), sector, 0, 0, 0, 0, t, 0, 0, 0)
        for a, t in zip(ANGLES_RAD, travel_times_s())
    ]
    header = struct.pack("<4HfI", 15000, 1, len(beams), len(beams), 1e4, 0)
    return header + struct.pack("<hH3fH2Bf", 0, 0, *[0.0] * 3, 0, 0, 0, 0.0) + b"".join(beams)


# GSF


def gsf(seconds=4.0, version=3):
    """Version, pings at 5 Hz with what they are placed by, attitudes at 50 Hz."""
    parts = [gsf_record(1, b"GSF-v0%d.09\0\0" % version), gsf_record(12, gsf_attitudes(seconds))]
    times_s = 0.2 * np.arange(int(5 * seconds) + 1)
    return b"".join(parts + [gsf_record(2, gsf_ping(t, version)) for t in times_s])


def gsf_record(kind, body):
    body += bytes(-len(body) % 4)
    return struct.pack(">2I", len(body), kind) + body


def gsf_time(time_s):
    return struct.pack(">2I", *divmod(round(1e9 * (START_S + time_s)), 1_000_000_000))


def gsf_attitudes(seconds):
    count = int(50 * seconds) + 2
    samples = [struct.pack(">H3hH", 20 * k, 0, 0, 0, 0) for k in range(count)]
    return gsf_time(0.0) + struct.pack(">H", count) + b"".join(samples)


def gsf_ping(time_s, version=3):
    beams = len(ANGLES_RAD)
    place = (round(1e7 * LONGITUDE_DEG), round(1e7 * latitude_deg(time_s)))
    head = struct.pack(">2i4H", *place, beams, beams // 2, 0, 0)
    # no tide; the sonar's depth; heading north, level
    head += struct.pack(">hiH3h2H", 0, round(100 * DOWN_M), 0, 0, 0, 0, 0, 0)
    head += bytes(14 if version > 2 else 0)
    across = np.round(1000 * (DEPTH_M - DOWN_M) * np.tan(ANGLES_RAD)).astype(">i4")
    depth = np.full(beams, round(1000 * DEPTH_M), ">u4")
    scales = b"".join(struct.pack(">4BIi", part, 0x40, 0, 0, 1000, 0) for part in (1, 2))
    parts = [(100, struct.pack(">I", 2) + scales), (1, depth.tobytes()), (2, across.tobytes())]
    packed = [struct.pack(">I", part << 24 | len(body)) + body for part, body in parts]
    return gsf_time(time_s) + head + b"".join(packed)
