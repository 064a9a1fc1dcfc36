"""Which reader a file is for: by its first bytes, not by its name."""

from __future__ import annotations

from pathlib import Path

from rbpf_svgp_slam.importers.all_file import is_all, read_all
from rbpf_svgp_slam.importers.kmall_file import is_kmall, read_kmall
from rbpf_svgp_slam.importers.sonar_recording import Recording
from rbpf_svgp_slam.importers.sonar_file import SonarFile
from rbpf_svgp_slam.importers.xtf_file import is_xtf, read_xtf

READERS = ((is_xtf, read_xtf), (is_kmall, read_kmall), (is_all, read_all))


def read_sonar_file(path: Path) -> Recording:
    """Raises ImportProblem, OSError."""
    file = SonarFile(path)
    for is_it, read in READERS:
        if is_it(file):
            recording = read(file)
            break
    else:
        expected = "XTF (0x7b), Kongsberg .all (0x02 at byte 4) or .kmall ('#' at byte 4)"
        raise file.error(0, f"{bytes(file.data[:8])!r}", expected)
    if not recording.swaths:
        raise file.error(len(file), "the file's end without a ping", "pings of a kind that is read")
    for what, count in (
        ("positions", len(recording.positions.time_s)),
        ("attitudes", len(recording.attitudes.time_s)),
    ):
        if not count:
            raise file.error(len(file), f"the file's end without {what}", what)
    return recording
