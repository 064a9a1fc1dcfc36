"""Runs one of the benchmarks' C++ programs, which print JSON."""

from __future__ import annotations

import json
import subprocess
from typing import Any

from bench.paths import BINARIES


def run(name: str, *arguments: str) -> dict[str, Any]:
    """What the program prints."""
    command = [str(BINARIES / name), *arguments]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
