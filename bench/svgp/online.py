"""Mapping while the vehicle moves: the log grows, and training has its share of the time only.

The survey's second half enters relief that is rougher than anything before (the paper's bump).
"""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from bench import figures
from bench.svgp.contestants import GPYTORCH_NEWEST, WorkerProcess, available, race_request
from bench.svgp.scores import Judge
from bench.svgp.surveys import (
    AREA_M,
    DURATION_S,
    LINE_SPACING_M,
    SPEED_MPS,
    BenchSurvey,
    relief_that_turns_rough,
    run_survey,
)

S, M, BEAMS = 400, 1000, 500_000
#: Seconds of training per second of survey: what each of 100 maps has on two cores.
TRAINING_SHARE = 0.02
FIRST_S, EVERY_S = 20.0, 30.0
OPTIMIZERS = ("adam", "natgrad", "streaming")


def run(out: Path) -> dict[str, Any]:
    """Mean RMSE and ELBO over the survey of each contestant, and the curves."""
    curves = _race(run_survey(relief_that_turns_rough(1), BEAMS, 1))
    figures.save(_figure(curves), out / "svgp_online.png")
    means = {
        f"online_mean_{score}_{name}": float(np.mean(curve[score]))
        for score in ("rmse_m", "elbo")
        for name, curve in curves.items()
    }
    return means | {"online": curves}


def _race(survey: BenchSurvey) -> dict[str, dict[str, list[float]]]:
    """Each contestant's survey_s, steps, rmse_m and elbo at times of the survey."""
    beams = survey.training
    request = race_request(beams.xyz_m, beams.arrival_s, survey.area_m, S, M)
    judge = Judge(beams, survey.held_out)
    with ExitStack() as stack:
        workers = [
            stack.enter_context(WorkerProcess(one, request))
            for one in [GPYTORCH_NEWEST, *available(OPTIMIZERS)]
        ]
        curves = {worker.contestant.name: _empty() for worker in workers}
        # there has to be something to draw from first
        clocks = {worker.contestant.name: FIRST_S for worker in workers}
        for end_s in np.arange(FIRST_S + EVERY_S, DURATION_S, EVERY_S):
            for worker in workers:
                name = worker.contestant.name
                clocks[name], steps = worker.train_until(clocks[name], end_s, TRAINING_SHARE)
                _record(curves[name], end_s, steps, judge.scores(worker, end_s))
    return curves


def _empty() -> dict[str, list[float]]:
    return {"survey_s": [], "steps": [], "rmse_m": [], "elbo": []}


def _record(
    curve: dict[str, list[float]], end_s: float, steps: int, scores: tuple[float, float]
) -> None:
    """Add one point to a curve."""
    steps += curve["steps"][-1] if curve["steps"] else 0
    for name, value in zip(curve, (float(end_s), steps, *scores)):
        curve[name].append(value)


def _figure(curves: dict[str, dict[str, list[float]]]) -> Figure:
    title = f"{TRAINING_SHARE:g} s of training per second of survey, S = {S}, M = {M}"
    figure = figures.score_curves(curves, "survey_s", "survey time (s)", title)
    # lines before the one along the border
    lines = 0.5 * AREA_M[1] / LINE_SPACING_M - 1
    rough_s = lines * (AREA_M[0] + LINE_SPACING_M) / SPEED_MPS
    for axes in figure.axes:
        axes.axvline(rough_s, label="rougher relief from here on", **figures.GUIDE)
    figure.axes[0].legend()
    return figure
