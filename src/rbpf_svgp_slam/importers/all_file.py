"""Kongsberg's .all: datagrams of SIS 4, little-endian.

Source: Kongsberg, EM series multibeam echo sounders, datagram formats, 850-160692, revision W.
"""

from __future__ import annotations

import calendar
from collections import Counter
from typing import Iterator

import numpy as np

from rbpf_svgp_slam.importers.kongsberg_installation import all_installation
from rbpf_svgp_slam.importers.sonar_file import SonarFile
from rbpf_svgp_slam.importers.sonar_recording import (
    Attitudes,
    Depths,
    Positions,
    Recording,
    SoundSpeedProfile,
    Swath,
    nothing_yet,
)

#: Length of what follows it, 2, type, model, date, milliseconds of the day, counter, serial number.
HEADER = "<IBBHIIHH"
BODY = 20  # where a datagram's own fields begin
BEGIN, END = 2, 3  # its second and its third but last byte
INSTALLATION, PING, SOLUTION, POSITION, ATTITUDE, PROFILE = b"INXPAU"

SECTOR = np.dtype(
    [("tilt_cdeg", "<i2"), ("focus", "<u2"), ("length_s", "<f4"), ("delay_s", "<f4")]
    + [("rest", "V12")]
)
BEAM = np.dtype(
    [("angle_cdeg", "<i2"), ("sector", "u1"), ("detection", "u1"), ("window", "<u2")]
    + [("quality", "<u2"), ("travel_time_s", "<f4"), ("rest", "V4")]
)
#: Of the maker's solution: down from the transmitter, starboard and forward of the vehicle.
SOUNDING = np.dtype([("z_m", "<f4"), ("y_m", "<f4"), ("x_m", "<f4"), ("rest", "V8")])
SAMPLE = np.dtype(
    [("ms", "<u2"), ("status", "<u2"), ("roll_cdeg", "<i2"), ("pitch_cdeg", "<i2")]
    + [("heave_cm", "<i2"), ("heading_cdeg", "<u2")]
)
NO_DETECTION = 0x80  # a bit
#: A transmitter that is further below its place in a ship belongs to a vehicle that dives.
DIVES_M = 1.0


def is_all(file: SonarFile) -> bool:
    """By the first datagram's begin and type, a letter or a figure."""
    return len(file) > 5 and file.data[4] == BEGIN and file.data[5:6].isalnum()


def read_all(file: SonarFile) -> Recording:
    """Pings (N), the maker's solution (X), positions (P), attitudes (A), profile, mounts."""
    recording = nothing_yet(file.path, "Kongsberg", speed_of_profile=True)
    depths: list[tuple[float, float]] = []  # of the transmitter
    solutions: dict[int, np.ndarray] = {}
    pings: list[tuple[int, Swath]] = []
    positions: dict[int, list[tuple[float, ...]]] = {}  # by the sensors' numbers
    attitudes: dict[int, list[np.ndarray]] = {}
    counts: Counter[str] = Counter()
    for offset, kind, time_s, counter in _datagrams(file, recording):
        counts[chr(kind)] += 1
        if kind == INSTALLATION:
            _add_installation(file, offset, recording)
        elif kind == PING:
            pings.append((counter, read_ping(file, offset, time_s)))
        elif kind == SOLUTION:
            depth_m, solutions[counter] = _solution(file, offset)
            depths.append((time_s, depth_m))
        elif kind == POSITION:
            sensor, place = _position(file, offset, time_s)
            positions.setdefault(sensor, []).append(place)
        elif kind == ATTITUDE:
            sensor, samples = _attitudes(file, offset, time_s)
            attitudes.setdefault(sensor, []).append(samples)
        elif kind == PROFILE and recording.profile is None:
            recording.profile = _profile(file, offset)
    recording.swaths += [_with_solution(swath, solutions.get(count)) for count, swath in pings]
    if positions:
        best = _most(positions, "positioning", recording)
        recording.positions = Positions(*np.array(best).T)
    if attitudes:
        best = _most(attitudes, "motion", recording)
        recording.attitudes = Attitudes(*np.concatenate(best, axis=1))
    _add_depths(recording, depths)
    named = ", ".join(f"{count} {kind}" for kind, count in counts.items())
    recording.found.append(f"datagrams: {named}")
    return recording


def _datagrams(file: SonarFile, recording: Recording) -> Iterator[tuple[int, int, float, int]]:
    """Offset, type, time and counter; of a last one that is cut off the recording tells."""
    offset = 0
    while offset < len(file):
        left = len(file) - offset
        if left < BODY:
            recording.cut_off = f"at byte {offset}: {left} bytes of a datagram's header"
            return
        length, begin, kind, _, date, ms, counter, _ = file.unpack(HEADER, offset, "a header")
        if begin != BEGIN or length < BODY - 1:
            raise file.error(offset, f"{length} bytes that begin with {begin}", "a datagram")
        if 4 + length > left:
            recording.cut_off = f"at byte {offset}: {left} bytes of a {chr(kind)} of {4 + length}"
            return
        end = offset + 4 + length
        if file.data[end - 3] != END:
            raise file.error(end - 3, f"{file.data[end - 3]}", f"{END}, a datagram's end")
        day = (date // 10000, date // 100 % 100, date % 100)
        try:
            midnight_s = calendar.timegm((*day, 0, 0, 0))
        except (ValueError, OverflowError) as error:
            raise file.error(offset + 8, f"the date {date}", "year, month, day") from error
        yield offset, kind, midnight_s + 1e-3 * ms, counter
        offset = end


def read_ping(file: SonarFile, offset: int, time_s: float) -> Swath:
    """The beams of an N, raw range and angle 78."""
    speed_dmps, sectors, beams = file.unpack("<3H", offset + BODY, "N")
    sector = file.array(SECTOR, sectors, offset + BODY + 16, "N's sectors")
    first = offset + BODY + 16 + sectors * SECTOR.itemsize
    beam = file.array(BEAM, beams, first, "N's beams")
    if beams and beam["sector"].max() >= sectors:
        raise file.error(first, f"a beam of sector {beam['sector'].max()}", f"one of {sectors}")
    of_beam = sector[beam["sector"]]
    good = (beam["detection"] & NO_DETECTION == 0) & (beam["travel_time_s"] > 0)
    return Swath(
        time_s=time_s,
        delay_s=of_beam["delay_s"].astype(float),
        travel_time_s=np.where(good, beam["travel_time_s"].astype(float), np.nan),
        tilt_rad=np.radians(0.01 * of_beam["tilt_cdeg"]),
        # Kongsberg's are positive to port
        angle_rad=-np.radians(0.01 * beam["angle_cdeg"]),
        surface_speed_mps=0.1 * speed_dmps,
    )


def _solution(file: SonarFile, offset: int) -> tuple[float, np.ndarray]:
    """Of an X, XYZ 88: the transmitter's depth; [B, 3] as Swath.maker_m has it."""
    transmitter_m, beams = file.unpack("<fH", offset + BODY + 4, "X")
    beam = file.array(SOUNDING, beams, offset + BODY + 20, "X's beams")
    columns = (beam["x_m"], beam["y_m"], beam["z_m"] + transmitter_m)
    return transmitter_m, np.column_stack(columns).astype(float)


def _add_depths(recording: Recording, depths: list[tuple[float, float]]) -> None:
    """Of a vehicle that dives, from those of its transmitter (X): no ship's draught changes so."""
    if not depths:
        return
    time_s, depth_m = np.array(depths).T
    installation = recording.installation
    below_m = depth_m - installation.transmitter.down_m
    if abs(np.median(below_m) + installation.waterline_m) > DIVES_M:
        recording.depths = Depths(time_s, below_m)
        recording.assumed.append("the transmitter's depth tells the vehicle's, in place of heave")


def _with_solution(swath: Swath, solution_m: np.ndarray | None) -> Swath:
    if solution_m is None or len(solution_m) != len(swath.angle_rad):
        return swath
    return Swath(**{**vars(swath), "maker_m": solution_m})


def _position(file: SonarFile, offset: int, time_s: float) -> tuple[int, tuple[float, ...]]:
    """The sensor's number, and time, latitude, longitude."""
    latitude, longitude = file.unpack("<2i", offset + BODY, "P")
    (sensor,) = file.unpack("<B", offset + BODY + 16, "P's descriptor")
    return sensor & 0b11, (time_s, latitude / 2e7, longitude / 1e7)


def _attitudes(file: SonarFile, offset: int, time_s: float) -> tuple[int, np.ndarray]:
    """The sensor's number, and columns [5, N] of Attitudes."""
    (count,) = file.unpack("<H", offset + BODY, "A")
    table = file.array(SAMPLE, count, offset + BODY + 2, "A's samples")
    (sensor,) = file.unpack("<B", offset + BODY + 2 + count * SAMPLE.itemsize, "A's descriptor")
    angles = (np.radians(0.01 * table[name]) for name in ("roll_cdeg", "pitch_cdeg"))
    heading_rad = np.radians(0.01 * table["heading_cdeg"])
    samples = [time_s + 1e-3 * table["ms"], *angles, heading_rad, 0.01 * table["heave_cm"]]
    return sensor >> 4 & 0b11, np.stack(samples)


def _profile(file: SonarFile, offset: int) -> SoundSpeedProfile:
    """Of a U; resolution of the depths in cm."""
    count, resolution_cm = file.unpack("<2H", offset + BODY + 8, "U")
    points = file.array("<u4", 2 * count, offset + BODY + 12, "U's points").reshape(-1, 2)
    depth_m, first = np.unique(0.01 * resolution_cm * points[:, 0], return_index=True)
    return SoundSpeedProfile(depth_m, 0.1 * points[first, 1])


def _add_installation(file: SonarFile, offset: int, recording: Recording) -> None:
    length, _, _, model = file.unpack("<IBBH", offset, "I")
    text = file.bytes(offset + BODY + 2, max(0, length - BODY - 1), "I's text")
    recording.sonar = f"Kongsberg EM{model}"
    try:
        recording.installation = all_installation(text.decode("latin-1"))
    except ValueError as error:
        raise file.error(offset, f"{error}", "numbers in the installation's text") from error


def _most(by_sensor: dict[int, list], what: str, recording: Recording) -> list:
    """What the sensor with the most datagrams has told."""
    best = max(by_sensor, key=lambda sensor: len(by_sensor[sensor]))
    if len(by_sensor) > 1:
        recording.assumed.append(f"the {what} sensor {best} of {sorted(by_sensor)}")
    return by_sensor[best]
