"""Whether a run folder can be written, asked before the survey and not after it."""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

from rbpf_svgp_slam.parameters.rules import ParameterError
from rbpf_svgp_slam.protocol import names

#: A run folder of an hour, with its journal and its products.
LEAST_FREE_MB = 500


#: What an earlier run has left: one read from a bag can be made again, a live one cannot.
OF_A_RUN = ("report.json", "survey.npz", "trajectory.tum")


def expect_no_earlier_run(folder: Path, offline: bool) -> None:
    """Refuse to write a live run over another, and one read from a bag over a live one.

    Raises ParameterError that names the file.
    """
    for name in (names.JOURNAL,) if offline else OF_A_RUN:
        if (folder / name).exists():
            raise ParameterError(
                f"~out is {folder}, which has {name} of an earlier "
                f"{'live survey' if offline else 'run'}; expected none, or overwrite:=true, which "
                "loses that run"
            )


def expect_room(folder: Path) -> None:
    """Make the folder and write into it.

    Raises ParameterError where that fails, or little space is left.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(prefix=".writable_", dir=folder) as probe:
            probe.write(b"\0" * 4096)
            probe.flush()
            os.fsync(probe.fileno())
        free_mb = shutil.disk_usage(folder).free / 1e6
    except OSError as error:
        raise ParameterError(
            f"~out is {folder}; expected a folder to write into ({error})"
        ) from error
    if free_mb < LEAST_FREE_MB:
        raise ParameterError(
            f"~out is {folder}, on whose disk {free_mb:.0f} MB are free; expected at least "
            f"{LEAST_FREE_MB} MB"
        )
