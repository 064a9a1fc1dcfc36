"""Which reader a file is for: by its first bytes, not by its name."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from rbpf_svgp_slam.importers.all_file import is_all, read_all
from rbpf_svgp_slam.importers.gsf_file import is_gsf, read_gsf
from rbpf_svgp_slam.importers.kmall_file import is_kmall, read_kmall
from rbpf_svgp_slam.importers.sonar_file import SonarFile
from rbpf_svgp_slam.importers.sonar_recording import (
    Positions,
    Recording,
    SoundSpeedProfile,
)
from rbpf_svgp_slam.importers.xtf_file import is_xtf, read_xtf

#: Of sound in the sea, and in fresh water, with room.
SPEEDS_MPS = (1300.0, 1800.0)
READERS = (
    (is_xtf, read_xtf),
    (is_kmall, read_kmall),
    (is_all, read_all),
    (is_gsf, read_gsf),
)


def read_sonar_file(path: Path) -> Recording:
    """Raises ImportProblem, OSError."""
    file = SonarFile(path)
    for is_it, read in READERS:
        if is_it(file):
            recording = read(file)
            break
    else:
        expected = (
            "XTF (0x7b), Kongsberg .all (0x02 at byte 4) or .kmall ('#' at byte 4), "
            "GSF ('GSF-v' at byte 8)"
        )
        raise file.error(0, f"{bytes(file.data[:8])!r}", expected)
    if not recording.swaths:
        raise file.error(len(file), "the file's end without a ping", "pings of a kind that is read")
    for what, count in (
        ("positions", len(recording.positions.time_s)),
        ("attitudes", len(recording.attitudes.time_s)),
    ):
        if not count:
            raise file.error(len(file), f"the file's end without {what}", what)
    return _plausible(file, recording)


def is_of_water(profile: SoundSpeedProfile) -> bool:
    """Whether depths increase and sound is as fast as in some water."""
    depth_m, speed_mps = profile.depth_m, profile.speed_mps
    if not len(depth_m) or not np.isfinite(depth_m).all() or (np.diff(depth_m) <= 0).any():
        return False
    return bool(((speed_mps > SPEEDS_MPS[0]) & (speed_mps < SPEEDS_MPS[1])).all())


def _plausible(file: SonarFile, recording: Recording) -> Recording:
    """Without positions that are none, as receivers without a fix tell them."""
    profile = recording.profile
    if profile is not None and not is_of_water(profile):
        found = f"a sound speed profile of depths {profile.depth_m}, speeds {profile.speed_mps}"
        raise file.error(0, found, "increasing depths, 1300 to 1800 m/s")
    places = recording.positions
    latitude_deg, longitude_deg = places.latitude_deg, places.longitude_deg
    good = (np.abs(latitude_deg) <= 90) & (np.abs(longitude_deg) <= 360)
    good &= (latitude_deg != 0) | (longitude_deg != 0)
    if good.all():
        return recording
    if not good.any():
        raise file.error(len(file), f"no good one of {len(good)} positions", "latitudes within 90°")
    recording.found.append(f"{np.sum(~good)} positions are none, and left out")
    columns = (places.time_s[good], latitude_deg[good], longitude_deg[good])
    return dataclasses.replace(recording, positions=Positions(*columns))
