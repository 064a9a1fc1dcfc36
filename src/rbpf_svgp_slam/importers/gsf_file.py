"""GSF, the Generic Sensor Format: soundings that others have computed; big-endian.

Source: Leidos, libgsf, the Generic Sensor Format's own library (gsf_dec.c). Read here and not by
it: it does not say where a file is broken, and its Python package, gsfpy, has it for x86-64 only.
"""

from __future__ import annotations

from collections import Counter
from typing import Iterator

import numpy as np

from rbpf_svgp_slam.importers.sonar_file import SonarFile
from rbpf_svgp_slam.importers.sonar_recording import (
    Attitudes,
    Depths,
    Positions,
    Recording,
    Soundings,
    nothing_yet,
)

RECORD = ">II"  # a record's size without this, and its flags and kind
HEADER, PING, ATTITUDE = 1, 2, 12
KIND, CHECKSUM = 0xFFF, 0x80000000  # bits
MAGIC = b"GSF-v"
MOST_BYTES = 524_288  # of a record

PING_HEAD = np.dtype(
    [("s", ">u4"), ("ns", ">u4"), ("longitude", ">i4"), ("latitude", ">i4"), ("beams", ">u2")]
    + [("centre", ">u2"), ("flags", ">u2"), ("reserved", ">u2"), ("tide_cm", ">i2")]
    + [("corrector_cm", ">i4"), ("heading_cdeg", ">u2"), ("pitch_cdeg", ">i2")]
    + [("roll_cdeg", ">i2"), ("heave_cm", ">i2"), ("course", ">u2"), ("speed", ">u2")]
)
SINCE_VERSION_3 = 14  # bytes after it: heights above the ellipsoid
SAMPLE = np.dtype(
    [("ms", ">u2"), ("pitch_cdeg", ">i2"), ("roll_cdeg", ">i2"), ("heave_cm", ">i2")]
    + [("heading_cdeg", ">u2")]
)
SCALE = np.dtype([("array", "u1"), ("form", "u1"), ("spare", "V2"), ("by", ">u4"), ("less", ">i4")])
SCALES, DEPTH, ACROSS, ALONG, BEAM_FLAGS = 100, 1, 2, 3, 16  # parts of a ping
SIGNED = {DEPTH: "u", ACROSS: "i", ALONG: "i"}
COMPRESSED = 0x0F  # bits of a scale's form
IGNORE = 0x01  # a bit of a ping's flags, and of a beam's
#: What stands for a value that is not known, in hundredths.
NO_HEADING, NO_ANGLE, NO_HEAVE, NO_CORRECTOR = 36100, 9900, 9900, 9999
#: Farther, in 30 s, no echo comes from.
FARTHEST_M = 22_500.0


def is_gsf(file: SonarFile) -> bool:
    """By the first record, which is the header."""
    return file.data[4:8] == b"\0\0\0\1" and file.data[8:13] == MAGIC


def read_gsf(file: SonarFile) -> Recording:
    """Pings with their positions, attitude records where they cover the pings."""
    recording = nothing_yet(file.path, "GSF")
    version = file.bytes(8, 10, "the version")
    if not version[5:7].isdigit():
        raise file.error(13, f"{version!r}", "GSF-v and a version")
    head_bytes = PING_HEAD.itemsize + SINCE_VERSION_3 * (int(version[5:7]) > 2)
    scales: dict[int, np.ndarray] = {}  # those of a ping hold until others come
    heads, samples = [], []
    counts: Counter[int] = Counter()
    for offset, kind, size in _records(file, recording):
        counts[kind] += 1
        if kind == ATTITUDE:
            samples.append(_attitudes(file, offset))
        elif kind == PING:
            end = offset + size
            if size < head_bytes:
                raise file.error(offset, f"a ping of {size} bytes", f"{head_bytes} or more")
            head = file.array(PING_HEAD, 1, offset, "a ping")[0]
            place_m = _beams(file, offset + head_bytes, end, int(head["beams"]), scales)
            if not head["flags"] & IGNORE and head["heading_cdeg"] < NO_HEADING:
                heads.append(head)
                heading_rad = np.radians(0.01 * head["heading_cdeg"])
                recording.swaths.append(Soundings(_time_s(head), heading_rad, place_m))
    if heads:
        _add_navigation(recording, np.array(heads), samples)
    beams = sum(int(head["beams"]) for head in heads)
    beams -= sum(len(soundings.place_m) for soundings in recording.swaths)
    named = ", ".join(f"{count} of kind {kind}" for kind, count in sorted(counts.items()))
    recording.found.append(f"{version.decode('latin-1')}, records: {named}")
    recording.found.append(
        f"rejected or unknown, and left out: {counts[PING] - len(heads)} pings, and {beams} beams "
        "of the others"
    )
    return recording


def _records(file: SonarFile, recording: Recording) -> Iterator[tuple[int, int, int]]:
    """Where a record's own bytes begin, kind and size; of one cut off the recording tells."""
    offset = 0
    while offset < len(file):
        left = len(file) - offset
        if left < 8:
            recording.cut_off = f"at byte {offset}: {left} bytes of a record's header"
            return
        size, flags = file.unpack(RECORD, offset, "a record's header")
        begin = offset + 8 + 4 * bool(flags & CHECKSUM)
        kind = flags & KIND
        if not HEADER <= kind <= ATTITUDE:
            raise file.error(offset, f"a record of kind {kind}", f"{HEADER} to {ATTITUDE}")
        if size > MOST_BYTES:
            raise file.error(offset, f"a record of {size} bytes", f"{MOST_BYTES} or less")
        if begin + size > len(file):
            recording.cut_off = f"at byte {offset}: {left} bytes of a record of {size}"
            return
        if flags & CHECKSUM:
            (told,) = file.unpack(">I", offset + 8, "a checksum")
            summed = int(file.array("u1", size, begin, "a record").sum(dtype=np.uint64))
            if summed & 0xFFFFFFFF != told:
                raise file.error(offset, f"bytes that sum to {summed}", f"{told}, the checksum")
        yield begin, kind, size
        offset = begin + size


def _beams(
    file: SonarFile, offset: int, end: int, beams: int, scales: dict[int, np.ndarray]
) -> np.ndarray:
    """[B, 3] as Soundings.place_m, without those that are rejected. scales: is kept up to date."""
    columns: dict[int, np.ndarray] = {ALONG: np.zeros(beams)}
    good = np.ones(beams, bool)
    while end - offset >= 4:  # fewer only fill up the record
        (word,) = file.unpack(">I", offset, "a part of a ping")
        part, size, offset = word >> 24, word & 0xFFFFFF, offset + 4
        if offset + size > end:
            raise file.error(offset - 4, f"{size} bytes of part {part}", f"{end - offset} or less")
        if part == SCALES:
            (count,) = file.unpack(">I", offset, "scale factors")
            table = file.array(SCALE, min(count, size // SCALE.itemsize), offset + 4, "scales")
            scales.update({int(row["array"]): row for row in table})
        elif part in SIGNED:
            columns[part] = _scaled(file, offset, size, beams, part, scales)
        elif part == BEAM_FLAGS and size >= beams:
            good = file.array("u1", beams, offset, "beam flags") & IGNORE == 0
        offset += size
    if not {DEPTH, ACROSS} <= columns.keys():
        return np.zeros((0, 3))
    place_m = np.column_stack([columns[ALONG], columns[ACROSS], columns[DEPTH]])
    good &= (np.abs(place_m) < FARTHEST_M).all(axis=1) & (place_m[:, 2] > 0)
    return place_m[good]


def _scaled(
    file: SonarFile, offset: int, size: int, beams: int, part: int, scales: dict[int, np.ndarray]
) -> np.ndarray:
    """An array [beams] of a ping, m. How wide its numbers are its size tells."""
    if not beams or size not in (beams, 2 * beams, 4 * beams):
        raise file.error(offset - 4, f"{size} bytes of part {part}", f"1, 2 or 4 for {beams} beams")
    scale = scales.get(part)
    if scale is None or not scale["by"]:
        raise file.error(offset - 4, f"part {part} without a scale", "scale factors before it")
    if scale["form"] & COMPRESSED:
        raise file.error(offset - 4, f"part {part} compressed", "an array as it is")
    numbers = file.array(f">{SIGNED[part]}{size // beams}", beams, offset, "an array")
    return numbers / float(scale["by"]) - float(scale["less"])


def _attitudes(file: SonarFile, offset: int) -> np.ndarray:
    """Columns [4, N]: time, roll, pitch, heave."""
    s, ns, count = file.unpack(">IIH", offset, "attitudes")
    table = file.array(SAMPLE, count, offset + 10, "attitudes")
    return np.stack([s + 1e-9 * ns + 1e-3 * table["ms"], *_motion(table)])


def _add_navigation(recording: Recording, heads: np.ndarray, samples: list[np.ndarray]) -> None:
    """Positions, headings and depths of the pings; roll and pitch of theirs or of the records."""
    time_s = _time_s(heads)
    recording.positions = Positions(time_s, 1e-7 * heads["latitude"], 1e-7 * heads["longitude"])
    motion = np.stack([time_s, *_motion(heads)])
    records = np.concatenate(samples, axis=1) if samples else np.zeros((4, 0))
    source = "the pings: no attitude records cover them"
    if records.size and records[0].min() <= time_s.min() and records[0].max() >= time_s.max():
        motion, source = records, "attitude records"
    order = np.argsort(time_s, kind="stable")
    heading_rad = np.unwrap(np.radians(0.01 * heads["heading_cdeg"][order]))
    heading_rad = np.interp(motion[0], time_s[order], heading_rad)
    recording.attitudes = Attitudes(*motion[:3], heading_rad, motion[3])
    recording.found.append(f"roll, pitch and heave of {source}; heading of the pings")
    if (heads["corrector_cm"] != NO_CORRECTOR).all():
        tide_cm = _known(heads["tide_cm"], NO_CORRECTOR)
        recording.depths = Depths(time_s, 0.01 * (heads["corrector_cm"] + tide_cm))
        recording.assumed.append(
            "the sonar as deep as the depth and tide correctors, which depths have in them, say; "
            "heave is in these"
        )
    recording.assumed += [
        "the positions are of the sonar, which the beams are given from",
        "WGS84 for latitude and longitude: the pings do not name their datum",
    ]


def _motion(table: np.ndarray) -> list[np.ndarray]:
    """Roll, pitch, heave [N]; 0 where they are not known, which moves no sounding."""
    angles = [_known(table[name], NO_ANGLE) for name in ("roll_cdeg", "pitch_cdeg")]
    return [*np.radians(0.01 * np.array(angles)), 0.01 * _known(table["heave_cm"], NO_HEAVE)]


def _known(numbers: np.ndarray, none: int) -> np.ndarray:
    return np.where(numbers == none, 0, numbers)


def _time_s(head: np.ndarray) -> np.ndarray:
    return head["s"] + 1e-9 * head["ns"]
