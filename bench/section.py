"""Runs one section of the benchmarks in a process of its own."""

from __future__ import annotations

import importlib
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from bench.paths import ROOT


def run(module: str, out: Path) -> dict[str, Any]:
    """What the module's run(out) returns. A process can be a ROS node only once in its life."""
    with tempfile.NamedTemporaryFile(suffix=".json") as result:
        command = [sys.executable, "-m", "bench.section", module, str(out), result.name]
        subprocess.run(command, check=True, cwd=ROOT)
        return json.loads(Path(result.name).read_text())


if __name__ == "__main__":
    _, name, folder, file = sys.argv
    Path(file).write_text(json.dumps(importlib.import_module(name).run(Path(folder))))
