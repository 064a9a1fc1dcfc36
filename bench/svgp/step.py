"""How long one Adam step takes, next to GPyTorch's: one thread, S = 400, M = 1000, Matérn-1/2."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from bench.svgp.contestants import (
    GPYTORCH_NEWEST,
    GPYTORCH_SAME_TORCH,
    WorkerProcess,
    ours,
    race_request,
)
from bench.svgp.surveys import run_survey, smooth_relief

S, M, BEAMS = 400, 1000, 100_000
STEPS_PER_BLOCK, BLOCKS = 20, 15
WARM_UP_STEPS = 10


def run(out: Path) -> dict[str, Any]:
    """Ratios of the medians, ours over theirs, and each one's minimum and median."""
    survey = run_survey(smooth_relief(1), BEAMS, 1)
    beams = survey.training
    request = race_request(beams.xyz_m, beams.arrival_s, survey.area_m, S, M)
    contestants = [ours("adam"), GPYTORCH_NEWEST, GPYTORCH_SAME_TORCH]
    with ExitStack() as stack:
        workers = [stack.enter_context(WorkerProcess(one, request)) for one in contestants]
        step_s = _take_turns(workers)
        figures = {
            worker.contestant.name: _summary(step_s[k]) | worker.versions
            for k, worker in enumerate(workers)
        }
    median = {name: figure["median_ms"] for name, figure in figures.items()}
    return {
        "adam_step_vs_gpytorch_newest": median["adam"] / median["gpytorch_newest"],
        "adam_step_vs_gpytorch_same_torch": median["adam"] / median["gpytorch_same_torch"],
        "adam_step": figures,
    }


def _take_turns(workers: list[WorkerProcess]) -> np.ndarray:
    """Seconds per step [workers, steps]; in blocks by turns, so that noise hits all alike."""
    for worker in workers:
        worker.train(WARM_UP_STEPS)
    rounds = [[worker.train(STEPS_PER_BLOCK) for worker in workers] for _ in range(BLOCKS)]
    return np.concatenate(rounds, axis=1)


def _summary(step_s: np.ndarray) -> dict[str, float]:
    return {
        "median_ms": 1e3 * float(np.median(step_s)),
        "min_ms": 1e3 * float(np.min(step_s)),
        "steps": len(step_s),
    }
