"""Steps, prompts, resamplings and memory over particles J, map nodes B and beams N."""

from __future__ import annotations

import statistics
from pathlib import Path
from typing import Any

from bench.core.filter_session import FilterSession, filter_session, svgp
from bench.ros_session import master

OPTIMIZER = "adam"  # whose steps do not depend on how many beams have been taken in
PARTICLES = (1, 10, 40, 100)
NODES = (1, 2, 4)
BEAMS = (100_000, 1_000_000, 12_400_000)
MEASURE_S = 6.0
REPEATS = 3
HEAD = "| J | B | N | steps/s | prompt, s | resampling, s | maps moved | core, MB | a node, MB |"


def run(out: Path) -> dict[str, Any]:
    """One row for each combination, as a list and as a table in scaling.md."""
    rows = []
    with master():
        for particles in PARTICLES:
            for nodes in NODES:
                if nodes <= particles:  # a node without a map is refused
                    rows += _rows(particles, nodes, out)
    (out / "scaling.md").write_text(_table(rows))
    print(_table(rows), flush=True)
    return {"scaling": rows}


def _rows(particles: int, nodes: int, out: Path) -> list[dict[str, Any]]:
    """The same nodes, with a log that grows."""
    with filter_session(particles, nodes, svgp(OPTIMIZER), out / "scaling.log") as session:
        rows = []
        for beams in BEAMS:
            session.grow(beams)
            session.wait_for_steps(1)
            row = {"particles": particles, "nodes": nodes, "beams": beams}
            rows.append(row | _measure(session))
        return rows


def _measure(session: FilterSession) -> dict[str, Any]:
    steps_per_s = session.steps_per_s(MEASURE_S)
    prompts, resamplings = [], []
    for _ in range(REPEATS):
        # so that every map has changed, and nothing is left of its last prediction
        session.wait_for_steps(2)
        prompts.append(session.prompt()["wall_s"])
        resamplings.append(session.resample())
    rss = session.rss_mb()
    core_mb = rss.pop("rbpf_core")
    return {
        "steps_per_s": steps_per_s,
        "prompt_s": statistics.median(prompts),
        "resampling_s": statistics.median(one["wall_s"] for one in resamplings),
        "maps_moved": statistics.mean(one["maps_moved"] for one in resamplings),
        "bytes_moved": statistics.mean(one["bytes_moved"] for one in resamplings),
        "core_rss_mb": core_mb,
        "largest_node_rss_mb": max(rss.values()),
    }


def _table(rows: list[dict[str, Any]]) -> str:
    lines = [HEAD, "|" + "---|" * (HEAD.count("|") - 1)]
    for row in rows:
        lines.append(
            f"| {row['particles']} | {row['nodes']} | {row['beams']:.3g} "
            f"| {row['steps_per_s']:.0f} | {row['prompt_s']:.3f} | {row['resampling_s']:.3f} "
            f"| {row['maps_moved']:.1f} | {row['core_rss_mb']:.0f} "
            f"| {row['largest_node_rss_mb']:.0f} |"
        )
    return "\n".join(lines) + "\n"
