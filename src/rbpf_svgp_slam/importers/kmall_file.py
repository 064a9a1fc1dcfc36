"""Kongsberg's .kmall: datagrams of SIS 5.

A reader of our own for the four datagrams needed; pykmall would bring pandas, reads them field by
field, and does not say where a file is broken. Source: Kongsberg, KMALL format description,
410224, revision I.
"""

from __future__ import annotations

from collections import Counter
from typing import Iterator

import numpy as np

from rbpf_svgp_slam.importers.kongsberg_installation import kmall_installation
from rbpf_svgp_slam.importers.sonar_file import SonarFile
from rbpf_svgp_slam.importers.sonar_recording import (
    Attitudes,
    Depths,
    Installation,
    Positions,
    Recording,
    SoundSpeedProfile,
    Swath,
    nothing_yet,
)

#: Length, '#' and three letters, version, system, echo sounder, seconds, nanoseconds.
HEADER = "<I4sBBHII"
HEADER_BYTES = 20
INSTALLATION, PING, ATTITUDE, PROFILE, DEPTH = b"#IIP", b"#MRZ", b"#SKM", b"#SVP", b"#SDE"
NORMAL_DETECTION = 0

#: The start of a beam in #MRZ; the file says how long it is.
BEAM = np.dtype(
    {
        "names": ["sector", "detection", "angle_deg", "angle_correction_deg", "travel_time_s"]
        + ["travel_time_correction_s", "z_m", "y_m", "x_m"],
        "formats": ["u1", "u1"] + ["<f4"] * 7,
        "offsets": [2, 3, 72, 76, 80, 84, 96, 100, 104],
        "itemsize": 120,
    }
)
#: A motion sensor's sample in #SKM, likewise; heave is down.
SAMPLE = np.dtype(
    {
        "names": ["s", "ns", "roll_deg", "pitch_deg", "heading_deg", "heave_m"],
        "formats": ["<u4", "<u4"] + ["<f4"] * 4,
        "offsets": [8, 12, 40, 44, 48, 52],
        "itemsize": 132,
    }
)


def is_kmall(file: SonarFile) -> bool:
    """By the first datagram's type: '#' and three capitals."""
    kind = bytes(file.data[4:8])
    return kind[:1] == b"#" and len(kind) == 4 and kind[1:].isalpha() and kind[1:].isupper()


def read_kmall(file: SonarFile) -> Recording:
    """Pings with positions (#MRZ), attitudes (#SKM), sound speed, installation, depths if any."""
    recording = nothing_yet(file.path, "Kongsberg", speed_of_profile=True)
    positions, attitudes, depths = [], [], []
    counts: Counter[bytes] = Counter()
    for offset, kind, time_s in _datagrams(file, recording):
        counts[kind] += 1
        if kind == INSTALLATION:
            recording.sonar, recording.installation = _installation(file, offset, recording)
        elif kind == PING:
            swath, latitude_deg, longitude_deg = read_ping(file, offset, time_s)
            recording.swaths.append(swath)
            positions.append((time_s, latitude_deg, longitude_deg))
        elif kind == ATTITUDE:
            attitudes.append(_attitudes(file, offset))
        elif kind == PROFILE and recording.profile is None:
            recording.profile = _profile(file, offset)
        elif kind == DEPTH:
            depths.append((time_s, *file.unpack("<f", offset + HEADER_BYTES + 8, "#SDE")))
    recording.positions = Positions(*np.array(positions, float).reshape(-1, 3).T)
    if attitudes:
        recording.attitudes = Attitudes(*np.concatenate(attitudes, axis=1))
    if depths:
        recording.depths = Depths(*np.array(depths, float).T)
    if not counts[INSTALLATION]:
        recording.assumed.append("all sensors at the reference point: the file has no #IIP")
    named = ", ".join(f"{count} {kind.decode('latin-1')}" for kind, count in counts.items())
    recording.found.append(f"datagrams: {named}")
    recording.found.append("positions are those of the pings, at the reference point")
    return recording


def _datagrams(file: SonarFile, recording: Recording) -> Iterator[tuple[int, bytes, float]]:
    """Offset, type and time of each; of a last one that is cut off the recording tells."""
    offset = 0
    while offset < len(file):
        left = len(file) - offset
        if left < HEADER_BYTES:
            recording.cut_off = f"at byte {offset}: {left} bytes of a datagram's header"
            return
        size, kind, _, _, _, s, ns = file.unpack(HEADER, offset, "a datagram's header")
        if kind[:1] != b"#" or size < HEADER_BYTES + 4:
            raise file.error(offset, f"{size} bytes of {kind!r}", "a datagram '#...'")
        if size > left:
            recording.cut_off = (
                f"at byte {offset}: {left} bytes of a {kind.decode('latin-1')} of {size}"
            )
            return
        (again,) = file.unpack("<I", offset + size - 4, "a datagram's end")
        if again != size:
            raise file.error(offset + size - 4, f"{again}", f"{size}, the datagram's length again")
        yield offset, kind, s + 1e-9 * ns
        offset += size


def read_ping(file: SonarFile, offset: int, time_s: float) -> tuple[Swath, float, float]:
    """The beams of #MRZ, and the reference point's latitude and longitude."""
    parts, _ = file.unpack("<2H", offset + HEADER_BYTES, "#MRZ's partition")
    if parts != 1:
        raise file.error(offset + HEADER_BYTES, f"#MRZ in {parts} parts", "one that is whole")
    common = offset + HEADER_BYTES + 4
    (common_bytes,) = file.unpack("<H", common, "#MRZ's common part")
    receiver, receivers = file.unpack("<2B", common + 9, "#MRZ's receivers")
    if receivers > 1:
        raise file.error(common + 10, f"receiver {receiver} of {receivers}", "a sonar with one")
    info = common + common_bytes
    (info_bytes,) = file.unpack("<H", info, "#MRZ's ping info")
    sectors, sector_bytes = file.unpack("<2H", info + 92, "#MRZ's sectors")
    speed_mps, _, water_m = file.unpack("<3f", info + 100, "#MRZ's water")
    latitude_deg, longitude_deg = file.unpack("<2d", info + 124, "#MRZ's position")
    delay_s, tilt_deg = _sectors(file, info + info_bytes, sectors, sector_bytes)
    beams = _beams(file, info + info_bytes + sectors * sector_bytes)
    if len(beams) and beams["sector"].max() >= sectors:
        found = f"a beam of sector {beams['sector'].max()}"
        raise file.error(offset, found, f"one of the ping's {sectors}")
    good = (beams["detection"] == NORMAL_DETECTION) & (beams["travel_time_s"] > 0)
    travel_time_s = beams["travel_time_s"].astype(float) + beams["travel_time_correction_s"]
    angle_deg = beams["angle_deg"].astype(float) + beams["angle_correction_deg"]
    swath = Swath(
        time_s=time_s,
        delay_s=delay_s[beams["sector"]],
        travel_time_s=np.where(good, travel_time_s, np.nan),
        tilt_rad=np.radians(tilt_deg[beams["sector"]]),
        # Kongsberg's are positive to port
        angle_rad=-np.radians(angle_deg),
        surface_speed_mps=speed_mps,
        maker_m=np.column_stack([beams["x_m"], beams["y_m"], beams["z_m"] - water_m]).astype(float),
    )
    return swath, latitude_deg, longitude_deg


def _sectors(
    file: SonarFile, offset: int, sectors: int, size: int
) -> tuple[np.ndarray, np.ndarray]:
    """Delay, s, and tilt, degrees, of each sector's transmission."""
    values = [
        file.unpack("<2f", offset + number * size + 4, "a sector of #MRZ")
        for number in range(sectors)
    ]
    delay_s, tilt_deg = np.array(values, float).reshape(-1, 2).T
    return delay_s, tilt_deg


def _beams(file: SonarFile, receiver: int) -> np.ndarray:
    """The main detections, as BEAM; extra ones, of what is in the water, stay out."""
    receiver_bytes, count, _, beam_bytes = file.unpack("<4H", receiver, "#MRZ's receiver info")
    _, _, classes, class_bytes = file.unpack("<4H", receiver + 24, "#MRZ's receiver info")
    first = receiver + receiver_bytes + classes * class_bytes
    return _table(file, BEAM, count, beam_bytes, first, "#MRZ's beams")


def _attitudes(file: SonarFile, offset: int) -> np.ndarray:
    """Columns [5, N] of Attitudes, from #SKM."""
    info = offset + HEADER_BYTES
    info_bytes, _, _, _, count, size = file.unpack("<H2B3H", info, "#SKM's info")[:6]
    table = _table(file, SAMPLE, count, size, info + info_bytes, "#SKM's samples")
    angles = [np.radians(table[name].astype(float)) for name in ("roll_deg", "pitch_deg")]
    return np.stack(
        [
            table["s"] + 1e-9 * table["ns"],
            *angles,
            np.radians(table["heading_deg"].astype(float)),
            -table["heave_m"].astype(float),
        ]
    )


def _table(
    file: SonarFile, dtype: np.dtype, count: int, size: int, offset: int, what: str
) -> np.ndarray:
    """Entries [count] of a size that the file tells; later revisions append to them."""
    needed = max(dtype.fields[name][1] + dtype.fields[name][0].itemsize for name in dtype.names)
    if size < needed:
        raise file.error(offset, f"{what} of {size} bytes each", f"{needed} or more")
    fields = {name: dtype.fields[name] for name in dtype.names}
    fitted = np.dtype(
        {
            "names": list(fields),
            "formats": [field[0] for field in fields.values()],
            "offsets": [field[1] for field in fields.values()],
            "itemsize": size,
        }
    )
    return file.array(fitted, count, offset, what)


def _profile(file: SonarFile, offset: int) -> SoundSpeedProfile:
    common_bytes, count = file.unpack("<2H", offset + HEADER_BYTES, "#SVP")
    first = offset + HEADER_BYTES + common_bytes
    points = file.array("<f4", 5 * count, first, "#SVP's points").reshape(-1, 5)
    return SoundSpeedProfile(points[:, 0].astype(float), points[:, 1].astype(float))


def _installation(file: SonarFile, offset: int, recording: Recording) -> tuple[str, Installation]:
    common_bytes, _, _ = file.unpack("<3H", offset + HEADER_BYTES, "#IIP")
    size = common_bytes - 6
    text = file.bytes(offset + HEADER_BYTES + 6, size, "#IIP's text").decode("latin-1")
    try:
        return kmall_installation(text, recording.assumed)
    except ValueError as error:
        raise file.error(offset, f"{error}", "numbers in the installation's text") from error
