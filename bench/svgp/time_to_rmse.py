"""Training time to a given map error, next to GPyTorch's Adam, on a dense survey."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from bench import figures
from bench.svgp.contestants import GPYTORCH_NEWEST, WorkerProcess, available, race_request
from bench.svgp.scores import Judge
from bench.svgp.surveys import BenchSurvey, run_survey, smooth_relief

S, M, BEAMS = 400, 1000, 500_000
REFERENCE_STEPS = 2000
#: Training steps of each of our optimizers. Adam gets more than GPyTorch's: being the same, it may
#: end a hair above the reference after as many steps. The others settle long before.
STEPS = {"adam": 2500, "natgrad": 1000, "streaming": 1000}
CHECKPOINTS, LATE_CHECKPOINTS = 40, [2100, 2250, 2500]


def run(out: Path) -> dict[str, Any]:
    """Ratios of time, ours over theirs, to GPyTorch's error after REFERENCE_STEPS; the curves."""
    curves = _race(run_survey(smooth_relief(1), BEAMS, 1))
    reference = curves[GPYTORCH_NEWEST.name]
    target_m, reference_s = reference["rmse_m"][-1], reference["training_s"][-1]
    results: dict[str, Any] = {
        "time_to_rmse": {"target_rmse_m": target_m, "gpytorch_newest_s": reference_s} | curves
    }
    for name, curve in curves.items():
        if name != GPYTORCH_NEWEST.name:
            time_s = time_to_stay_below(curve, target_m)
            results[f"{name}_time_to_rmse_vs_gpytorch_newest"] = time_s and time_s / reference_s
    figures.save(_figure(curves, target_m), out / "svgp_time_to_rmse.png")
    return results


def time_to_stay_below(curve: dict[str, list[float]], rmse_m: float) -> float | None:
    """Training time, s, after which no checkpoint has a larger error; None if there is none."""
    above = np.flatnonzero(np.array(curve["rmse_m"]) > rmse_m)
    first = above[-1] + 1 if len(above) else 0
    return curve["training_s"][first] if first < len(curve["training_s"]) else None


def _race(survey: BenchSurvey) -> dict[str, dict[str, list[float]]]:
    """Each contestant's steps, training_s, rmse_m and elbo at its checkpoints."""
    beams = survey.training
    request = race_request(beams.xyz_m, beams.arrival_s, survey.area_m, S, M)
    judge = Judge(beams, survey.held_out)
    with ExitStack() as stack:
        workers = [
            stack.enter_context(WorkerProcess(one, request))
            for one in [GPYTORCH_NEWEST, *available(tuple(STEPS))]
        ]
        curves = {worker.contestant.name: _empty() for worker in workers}
        # by turns, so that the machine's noise hits all alike
        for steps in _checkpoints():
            for worker in workers:
                if steps <= STEPS.get(worker.contestant.name, REFERENCE_STEPS):
                    _advance(worker, judge, steps, curves[worker.contestant.name])
    return curves


def _checkpoints() -> list[int]:
    """Numbers of steps, evenly spaced on a logarithmic axis."""
    steps = np.geomspace(5, REFERENCE_STEPS, CHECKPOINTS).round().astype(int)
    return np.unique(steps).tolist() + LATE_CHECKPOINTS


def _empty() -> dict[str, list[float]]:
    return {"steps": [], "training_s": [], "rmse_m": [], "elbo": []}


def _advance(
    worker: WorkerProcess, judge: Judge, steps: int, curve: dict[str, list[float]]
) -> None:
    """Train to that many steps, and add a checkpoint to the curve."""
    done, seconds = (curve[name][-1] if curve["steps"] else 0 for name in ("steps", "training_s"))
    seconds += float(worker.train(steps - done).sum())
    rmse_m, elbo = judge.scores(worker)
    for name, value in zip(curve, (steps, seconds, rmse_m, elbo)):
        curve[name].append(value)


def _figure(curves: dict[str, dict[str, list[float]]], target_m: float) -> Figure:
    title = f"{BEAMS:,} beams, S = {S}, M = {M}, one thread"
    figure = figures.score_curves(curves, "training_s", "training time (s)", title)
    label = f"GPyTorch's after {REFERENCE_STEPS} steps"
    figure.axes[0].axhline(target_m, label=label, **figures.GUIDE)
    figure.axes[0].legend()
    for axes in figure.axes:
        axes.set_xscale("log")
    return figure
