"""What the core's journal costs: space, processor time, what input is held up, time to resume."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from bench.core import program

#: By name: particles, pings a second, beams, hours.
CASES = {
    "j40_1h": (40, 5, 256, 1.0),
    "j40_8h": (40, 5, 256, 8.0),
    "large_sonar_1h": (40, 20, 512, 1.0),
}
_PER_HOUR = "j40_1h"


def run(out: Path) -> dict[str, Any]:
    """By case; and of the first one, MB and seconds of processor in an hour of survey."""
    with tempfile.TemporaryDirectory() as folder:
        file = str(Path(folder) / "survey.journal")
        cases = {
            name: program.run("bench_journal", file, *map(str, case))
            for name, case in CASES.items()
        }
    hour = cases[_PER_HOUR]
    return {
        "journal_mb_per_hour": hour["mb"],
        "journal_processor_s_per_hour": hour["processor_s_with"] - hour["processor_s_without"],
        "journal": cases,
    }
