"""A prompt's weights at J = 100, and the maps that change node when half are replaced."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from bench.core import program
from bench.svgp.in_process import group, markdown, square

AREA = square(centre_m=0.0, side_m=200.0)


def run(out: Path) -> dict[str, Any]:
    """Milliseconds by weight rule; maps and MB per resampling by numbering and nodes."""
    measured = program.run("bench_weights_and_numbering")
    map_mb = len(group(AREA, optimizer="streaming").create().to_bytes()) / 1e6
    rows = [_row(nodes, traffic, map_mb) for nodes, traffic in measured["numbering"].items()]
    print(markdown(rows))
    return {
        "weights_ms": measured["weights_ms"],
        "numbering": {"map_mb": map_mb, "by_nodes": measured["numbering"]},
    }


def _row(nodes: str, traffic: dict[str, float], map_mb: float) -> dict[str, Any]:
    return {
        "nodes": nodes,
        "particles replaced, %": 100.0 * traffic["replaced_share"],
        "maps, in the order of systematic resampling": traffic["plain"],
        "maps, numbered": traffic["ours"],
        "MB, in that order": map_mb * traffic["plain"],
        "MB, numbered": map_mb * traffic["ours"],
    }
