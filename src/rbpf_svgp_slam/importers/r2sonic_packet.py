"""R2Sonic's bathymetry packet BTH0: big-endian sections, each with its name and its size.

Source: R2Sonic, Sonic 2026/2024/2022 operation manual, appendix on data formats.
"""

from __future__ import annotations

import numpy as np

from rbpf_svgp_slam.importers.sonar_recording import Swath
from rbpf_svgp_slam.importers.sonar_file import SonarFile

NAME = b"BTH0"
#: Bits of a beam's four: brightness and collinearity tests passed; a detection passes both.
GOOD = 0b0011


def read_bathymetry(file: SonarFile, offset: int, end: int) -> tuple[str, Swath]:
    """The sonar's name and a ping's beams; the packet lies between both offsets."""
    name, size = file.unpack(">4sI", offset, "an R2Sonic packet's start")
    if name != NAME:
        raise file.error(offset, repr(name), f"{NAME!r}, R2Sonic's bathymetry")
    if offset + size > end:
        found = f"an R2Sonic packet of {size} bytes"
        raise file.error(offset + 4, found, f"at most the {end - offset} bytes of what holds it")
    sections = _sections(file, offset, offset + size)
    for needed in (b"H0", b"R0"):
        if needed not in sections:
            raise file.error(offset, f"sections {list(sections)}", f"{needed!r} among them")
    header = file.unpack(">12s12s3I2f", sections[b"H0"] + 4, "section H0")
    model, _, seconds, nanoseconds, _, _, speed_mps = header
    (beams,) = file.unpack(">H", sections[b"H0"] + 114, "section H0's number of points")
    travel_time_s = _scaled(file, sections[b"R0"] + 4, 8, beams, "section R0")
    good = travel_time_s > 0
    if b"Q0" in sections:
        good &= _quality(file, sections[b"Q0"], beams) & GOOD == GOOD
    swath = Swath(
        time_s=seconds + 1e-9 * nanoseconds,
        delay_s=np.zeros(beams),
        travel_time_s=np.where(good, travel_time_s, np.nan),
        tilt_rad=np.zeros(beams),
        angle_rad=_angles(file, sections, beams, offset),
        surface_speed_mps=speed_mps,
    )
    return "R2Sonic " + model.rstrip(b"\0").decode("ascii", "replace"), swath


def _sections(file: SonarFile, offset: int, end: int) -> dict[bytes, int]:
    """Where each section begins, by name."""
    sections = {}
    at = offset + 12
    while at < end:
        name, size = file.unpack(">2sH", at, "a section's start")
        if size < 4 or at + size > end:
            found = f"section {name!r} of {size} bytes"
            raise file.error(at, found, f"4 to the packet's last {end - at}")
        sections[name] = at
        at += size
    return sections


def _angles(file: SonarFile, sections: dict[bytes, int], beams: int, offset: int) -> np.ndarray:
    """From the array's centre line to starboard, rad [beams]: evenly spaced, or in steps."""
    if b"A0" in sections:
        return np.linspace(*file.unpack(">2f", sections[b"A0"] + 4, "section A0"), beams)
    if b"A2" not in sections:
        raise file.error(offset, f"sections {list(sections)}", "angles, A0 or A2")
    first_rad, scale_rad = file.unpack(">2f", sections[b"A2"] + 4, "section A2")
    steps = file.array(">u2", beams, sections[b"A2"] + 36, "section A2")
    # the sum reaches beyond 16 bits
    return first_rad + np.cumsum(steps, dtype=np.uint32) * scale_rad


def _scaled(file: SonarFile, scale_at: int, array_at: int, beams: int, what: str) -> np.ndarray:
    """Whole numbers [beams] times the factor before them; array_at: after the section's start."""
    (scale,) = file.unpack(">f", scale_at, what)
    return file.array(">u2", beams, scale_at - 4 + array_at, what) * float(scale)


def _quality(file: SonarFile, section: int, beams: int) -> np.ndarray:
    """Four bits a beam [beams], the first beam's in the higher half of the first byte."""
    packed = file.array("u1", (beams + 1) // 2, section + 4, "section Q0")
    return np.column_stack([packed >> 4, packed & 0xF]).ravel()[:beams]
