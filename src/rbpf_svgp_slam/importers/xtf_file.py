"""XTF files of R2Sonic sonars. pyxtf knows the container's structures.

The walk from packet to packet is ours: pyxtf's does not say where a file is broken, never ends at a
packet of length 0, and unpickles an index that lies beside the file. Source: Triton Imaging,
eXtended Triton File format, rev. 42.
"""

from __future__ import annotations

import calendar
import math
from collections import Counter
from typing import Any, Iterator

import numpy as np

from rbpf_svgp_slam.importers.r2sonic_packet import read_bathymetry
from rbpf_svgp_slam.importers.sonar_recording import (
    Attitudes,
    Installation,
    Placed,
    Positions,
    Recording,
    nothing_yet,
)
from rbpf_svgp_slam.importers.sonar_file import ImportProblem, SonarFile

FORMAT = 123  # a file's first byte
MAGIC = 0xFACE
ATTITUDE, NAVIGATION, RAW_NAVIGATION = 3, 42, 107
#: The same packet in both, after a ping header.
R2SONIC = {65: "by QINSy", 68: "by Triton"}
FILE_HEADER_BYTES, PING_HEADER_BYTES, PACKET_START_BYTES = 1024, 256, 14
DEGREES_OF_LATITUDE = 3  # a file header's NavUnits


def is_xtf(file: SonarFile) -> bool:
    """By the first byte, and a packet where the first must be."""
    if file.data[0] != FORMAT:
        return False
    return len(file) < FILE_HEADER_BYTES + 2 or file.data[1024:1026] == b"\xce\xfa"


def read_xtf(file: SonarFile) -> Recording:
    """Positions, attitudes and R2Sonic's pings. Raises ImportProblem."""
    pyxtf = _pyxtf()
    file.need(0, FILE_HEADER_BYTES, "file header")
    header = pyxtf.XTFFileHeader.create_from_buffer(file.data[:FILE_HEADER_BYTES])
    if header.NavUnits != DEGREES_OF_LATITUDE:
        found = f"NavUnits {header.NavUnits}"
        raise file.error(164, found, f"{DEGREES_OF_LATITUDE}, latitude and longitude")
    positions, attitudes = [], []
    counts: Counter[int] = Counter()
    recording = nothing_yet(file.path, "R2Sonic")
    for offset, kind, size in _packets(file, recording):
        counts[kind] += 1
        if kind in R2SONIC:
            recording.sonar, swath = read_bathymetry(
                file, offset + PING_HEADER_BYTES, offset + size
            )
            recording.swaths.append(swath)
        elif kind == ATTITUDE:
            file.need(offset, 64, "an attitude packet")
            attitudes.append(_attitude(pyxtf, file, offset))
        elif kind in (NAVIGATION, RAW_NAVIGATION):
            file.need(offset, 64, "a navigation packet")
            positions.append(_position(pyxtf, kind, file, offset))
    recording.positions = Positions(*np.array(positions, float).reshape(-1, 3).T)
    recording.attitudes = Attitudes(*np.array(attitudes, float).reshape(-1, 5).T)
    recording.installation = _installation(header, recording)
    recording.found += _counted(counts)
    recording.assumed.append("WGS84 for latitude and longitude: the file does not name its datum")
    return recording


def _pyxtf() -> Any:
    try:
        import pyxtf  # an optional package
    except ImportError as error:
        raise ImportProblem(
            f"XTF files are read with pyxtf, which is not there ({error}); tools/requirements.sh "
            "installs it"
        ) from error
    return pyxtf


def _packets(file: SonarFile, recording: Recording) -> Iterator[tuple[int, int, int]]:
    """Offset, type and size of each packet; of a last one that is cut off the recording tells."""
    offset = FILE_HEADER_BYTES
    while offset < len(file):
        left = len(file) - offset
        if left < PACKET_START_BYTES:
            recording.cut_off = f"at byte {offset}: {left} bytes of a packet's start"
            return
        magic, kind, _, _, _, size = file.unpack("<HBBHII", offset, "a packet's start")
        if magic != MAGIC:
            raise file.error(offset, f"0x{magic:04x}", f"0x{MAGIC:04x}, which begins a packet")
        if size < PACKET_START_BYTES:
            raise file.error(offset + 10, f"a packet of {size} bytes", "64 or more")
        if size > left:
            recording.cut_off = f"at byte {offset}: {left} bytes of a packet of {size}"
            return
        yield offset, kind, size
        offset += size


def _attitude(pyxtf: Any, file: SonarFile, offset: int) -> tuple[float, ...]:
    """Time, roll, pitch, heading, heave."""
    packet = pyxtf.XTFAttitudeData.from_buffer_copy(file.data, offset)
    angles = (packet.Roll, packet.Pitch, packet.Heading)
    time_s = _time_s(file, offset, packet) + packet.Millisecond * 1e-3
    return (time_s, *map(math.radians, angles), packet.Heave)


def _position(pyxtf: Any, kind: int, file: SonarFile, offset: int) -> tuple[float, ...]:
    """Time, latitude, longitude. What is called Microsecond has two meanings."""
    if kind == RAW_NAVIGATION:
        packet = pyxtf.XTFPosRawNavigation.from_buffer_copy(file.data, offset)
        fraction_s = packet.Microsecond * 1e-4
    else:
        packet = pyxtf.XTFHeaderNavigation.from_buffer_copy(file.data, offset)
        fraction_s = packet.Microsecond * 1e-6
    time_s = _time_s(file, offset, packet) + fraction_s
    return time_s, packet.RawYcoordinate, packet.RawXcoordinate


def _time_s(file: SonarFile, offset: int, packet: Any) -> int:
    """Of whole seconds."""
    date = (packet.Year, packet.Month, packet.Day, packet.Hour, packet.Minute, packet.Second)
    try:
        return calendar.timegm(date)
    except (ValueError, OverflowError) as error:
        raise file.error(offset, f"the date {date}", "year, month, day, time") from error


def _installation(header: Any, recording: Recording) -> Installation:
    """Lever arms and angles of the file header: X to starboard, Y forward, Z down, degrees."""
    # positive: turned to starboard (yaw), nose up (pitch), starboard down (roll), as ours
    sonars = header.bathy_info[:1]
    if not sonars:
        recording.assumed.append("the sonar at the reference point: the file has no channel for it")
    sonar = sonars[0] if sonars else None
    array = Placed() if sonar is None else _placed(sonar, "Offset")
    recording.assumed.append(
        "the reference point at the waterline (--waterline): XTF does not tell its height"
    )
    navigation = Placed(header.NavOffsetY, header.NavOffsetX, header.NavOffsetZ)
    return Installation(array, array, navigation, _placed(header, "MRUOffset"))


def _placed(structure: Any, prefix: str) -> Placed:
    place = (getattr(structure, prefix + axis) for axis in "YXZ")
    angles = (getattr(structure, prefix + angle) for angle in ("Roll", "Pitch", "Yaw"))
    return Placed(*place, *map(math.radians, angles))


def _counted(counts: Counter[int]) -> list[str]:
    """Lines for the summary."""
    used = {ATTITUDE, NAVIGATION, RAW_NAVIGATION, *R2SONIC}
    lines = [
        f"{counts[kind]} R2Sonic pings, {who}" for kind, who in R2SONIC.items() if counts[kind]
    ]
    unused = {kind: count for kind, count in counts.items() if kind not in used}
    others = ", ".join(f"{count} of type {kind}" for kind, count in unused.items())
    return lines + ([f"packets that are not used: {others}"] if others else [])
