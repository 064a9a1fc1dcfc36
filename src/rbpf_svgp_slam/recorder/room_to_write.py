"""Whether a run folder can be written, asked before the survey and not after it."""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

from rbpf_svgp_slam.parameters.rules import ParameterError

#: A run folder of an hour, with its journal and its products.
LEAST_FREE_MB = 500


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
