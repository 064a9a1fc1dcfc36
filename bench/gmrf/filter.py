"""A thousand particles with gmrf maps: what folding, a prompt and a resampling cost real nodes."""

from __future__ import annotations

import statistics
import time
from pathlib import Path
from typing import Any

from bench.core.filter_session import FilterSession, filter_session
from bench.ros_session import cpu_s, master, wait_until

PARTICLES, NODES = 1000, 2
PING_BEAMS = 256
#: The log to begin with, and what is added to it, to be folded by every map.
BEAMS, NEW_BEAMS = 200_000, 100_000
#: Live, beams of a sonar in a second.
BEAMS_PER_S = 1530
REPEATS = 9
PATIENCE_S = 600.0
#: As for lolo3, whose beams have noise.
MAPS = {"map": {"engine": "gmrf"}, "gmrf": {"spacing_m": 2.0, "noise_std_m": 0.05}}


#: Longer than map nodes take from telling their state to telling it again.
STATUS_PERIODS_S = 1.5


def run(out: Path) -> dict[str, Any]:
    """Times, s, processors, and memory with PARTICLES particles."""
    with master(), filter_session(
        PARTICLES, NODES, MAPS, out / "gmrf_filter.log", PING_BEAMS
    ) as session:
        _fold(session, BEAMS)
        busy_s, taken_s = _fold(session, BEAMS + NEW_BEAMS)
        prompts = [session.prompt()["wall_s"] for _ in range(REPEATS)]
        resamplings = [session.resample() for _ in range(REPEATS)]
        rss_mb = session.rss_mb()
    return {
        "fold_cores_j1000": busy_s * BEAMS_PER_S / NEW_BEAMS,
        "prompt_s_j1000": statistics.median(prompts),
        "resampling_s_j1000": statistics.median(one["wall_s"] for one in resamplings),
        "filter": {
            "particles": PARTICLES,
            "nodes": NODES,
            "ping_beams": PING_BEAMS,
            "fold_ns_per_beam_and_map": 1e9 * busy_s / (NEW_BEAMS * PARTICLES),
            "fold_beams_per_s": NEW_BEAMS / taken_s,
            "prompt_s_largest": max(prompts),
            "resampling_s_largest": max(one["wall_s"] for one in resamplings),
            "maps_moved": statistics.mean(one["maps_moved"] for one in resamplings),
            "bytes_moved": statistics.mean(one["bytes_moved"] for one in resamplings),
            "rss_mb": rss_mb,
        },
    }


def _fold(session: FilterSession, beams: int) -> tuple[float, float]:
    """Let the log grow, and every map take it in: processor and wall time, s, of the map nodes."""
    start_s, before_s = time.monotonic(), sum(map(cpu_s, session.names[1:]))
    steps = session.steps_per_map()
    session.grow(beams)
    wait_until(lambda: session.steps_per_map() > steps, "the first blocks", PATIENCE_S)
    while session.steps_per_map() > steps:  # goes on until nothing is left
        steps = session.steps_per_map()
        time.sleep(STATUS_PERIODS_S)
    busy_s = sum(map(cpu_s, session.names[1:])) - before_s
    return busy_s, time.monotonic() - start_s - STATUS_PERIODS_S
