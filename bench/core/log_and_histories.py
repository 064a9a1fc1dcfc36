"""The log and the histories at 12.4 million beams: minibatches per second, and memory."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from bench.core import program

#: Pointer segments, and the peer.
HISTORIES = ("segments", "ancestry_tree")
RESAMPLINGS = (1, 10, 100, 1000)
MEMORY_RESAMPLINGS = (0, *RESAMPLINGS)


def run(out: Path) -> dict[str, Any]:
    """Beams per second and core placed into minibatches, and resident memory, over resamplings."""
    rates = _rates(out)
    memory = {count: program.run("bench_memory", str(count)) for count in MEMORY_RESAMPLINGS}
    most = RESAMPLINGS[-1]
    return {
        "beams_per_s_1_resampling": rates["segments"][1],
        f"beams_per_s_{most}_resamplings": rates["segments"][most],
        f"ancestry_tree_beams_per_s_{most}_resamplings": rates["ancestry_tree"][most],
        "log_and_histories_mb": memory[most]["resident_mb"],
        "log_and_histories": {"beams_per_s": rates, "memory": memory},
    }


def _rates(out: Path) -> dict[str, dict[int, float]]:
    """Beams per second by histories and resamplings."""
    report = program.run("bench_minibatches", "--benchmark_format=json")
    (out / "minibatches.json").write_text(json.dumps(report, indent=2))
    measured = {one["name"]: one["items_per_second"] for one in report["benchmarks"]}
    return {
        name: {count: measured[f"{name}/{count}"] for count in RESAMPLINGS} for name in HISTORIES
    }
