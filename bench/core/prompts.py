"""Loop-closure prompts and resamplings of 100 particles, with the maps in training."""

from __future__ import annotations

import statistics
import time
from pathlib import Path
from typing import Any

from bench.core.filter_session import FilterSession, filter_session, svgp
from bench.ros_session import master

PARTICLES, NODES = 100, 2
#: The default, and the paper's; maps of natgrad are like Adam's.
OPTIMIZERS = ("streaming", "adam")
BEAMS = 100_000
STEPS = 20  # of a map, before it is asked for anything
REPEATS = 7
#: Between two prompts: new beams, which all maps take in, and the time for that or for their steps.
NEW_BEAMS, PAUSE_S = 5_000, 4.0
PATIENCE_S = 300.0


def run(out: Path) -> dict[str, Any]:
    """prompt_s_j100 and resampling_s_j100 (medians), and what is behind them by optimizer."""
    with master():
        measured = {name: _measure(name, out) for name in OPTIMIZERS}
    default = measured[OPTIMIZERS[0]]
    return {
        "prompt_s_j100": default["prompt_s"],
        "resampling_s_j100": default["resampling_s"],
        "prompts": measured,
    }


def _prompt(session: FilterSession, beams: int) -> dict[str, Any]:
    """A prompt after every map has changed since the last one, as in a survey."""
    session.grow(beams)
    time.sleep(PAUSE_S)
    return session.prompt()


def _measure(optimizer: str, out: Path) -> dict[str, Any]:
    with filter_session(
        PARTICLES, NODES, svgp(optimizer), out / f"prompts_{optimizer}.log"
    ) as session:
        session.grow(BEAMS)
        session.wait_for_steps(STEPS, PATIENCE_S)
        training = session.steps_per_s(5.0)
        prompts = [_prompt(session, BEAMS + k * NEW_BEAMS) for k in range(1, REPEATS + 1)]
        resamplings = [session.resample() for _ in range(REPEATS)]
        return {
            "prompt_s": statistics.median(prompt["wall_s"] for prompt in prompts),
            "prompt_s_largest": max(prompt["wall_s"] for prompt in prompts),
            "outcomes": sorted({prompt["outcome"] for prompt in prompts}),
            "resampling_s": statistics.median(one["wall_s"] for one in resamplings),
            "resampling_s_largest": max(one["wall_s"] for one in resamplings),
            "particles_replaced": PARTICLES // 2,
            "maps_moved": statistics.mean(one["maps_moved"] for one in resamplings),
            "bytes_moved": statistics.mean(one["bytes_moved"] for one in resamplings),
            "steps_per_s": training,
            "rss_mb": session.rss_mb(),
        }
