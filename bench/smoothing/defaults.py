"""What each parameter of the smoothing is worth: half and twice its default, beside the default.

From dead reckoning alone, on seeds that the study's tables do not use. defaults.md has, for each
value, the median over the seeds of the errors over those that the default leaves: 1.1 is a tenth
worse. In the environment DEFAULT_SEEDS (3) makes it shorter, and DEFAULT_PARAMETERS, names apart by
blanks, leaves out all others.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from bench.smoothing.simulated_runs import REAL_SEABED, as_run
from bench.study.cases import cases
from bench.svgp.in_process import markdown
from rbpf_svgp_slam.metrics.closure_metrics import closure_metrics
from rbpf_svgp_slam.metrics.normalised_errors import nees
from rbpf_svgp_slam.metrics.trajectory_errors import ate_aligned_rmse, ate_rmse
from rbpf_svgp_slam.nested import merged
from rbpf_svgp_slam.run.survey_run import SurveyRun
from rbpf_svgp_slam.smoothing.smooth_run import smooth_run
from rbpf_svgp_slam.smoothing.smoothing_parameters import smoothing_params

FIRST_SEED = 1
#: Much relief and little, dead reckoning whose biases matter, and lines that overlap less.
CASES = ["base", "rippled", "block_b", "slope", "flat", "cheap", "overlap50", "overlap10"]
#: Half and twice the default, or about that.
VALUES: dict[str, tuple[float, ...]] = {
    "window_s": (3.0, 12.0),
    "map_window_s": (7.0, 28.0),
    "min_apart_s": (30.0, 120.0),
    "passes": (1, 6),
    "effective_beams": (15.0, 20.0, 80.0),
    "velocity_bias_std_mps": (0.005, 0.05),
    "yaw_bias_std_radps": (1e-5, 2e-4),
    "current_std_mps": (0.0, 0.0015, 0.01),
    "bias_time_s": (900.0, 14400.0),
}


def run(out: Path) -> dict[str, Any]:
    """Errors over those of the defaults, by parameter and value."""
    seeds = range(FIRST_SEED, FIRST_SEED + int(os.environ.get("DEFAULT_SEEDS", "3")))
    chosen = [name for name in CASES if name != "block_b" or REAL_SEABED.exists()]
    parameters = os.environ.get("DEFAULT_PARAMETERS", " ".join(VALUES)).split()
    changes = [{}] + [{name: v} for name in parameters for v in VALUES[name]]
    errors: dict[str, list[list[dict[str, float]]]] = {name: [] for name in chosen}
    for name, seed in ((name, seed) for seed in seeds for name in chosen):
        survey = as_run(cases([name])[0].survey(seed))
        errors[name].append([score(survey, change) for change in changes])
        print(f"{name}, seed {seed}: {errors[name][-1][0]}", flush=True)
    rows = [_row(change, k, errors) for k, change in enumerate(changes)]
    table = markdown(rows)
    (out / "defaults.md").write_text(table + "\n", encoding="utf-8")
    print(table, flush=True)
    return {"defaults": {row["parameter"]: row for row in rows}}


def score(survey: SurveyRun, change: dict[str, float]) -> dict[str, float]:
    """Errors of the survey smoothed with the change."""
    config = merged(survey.config, {"smoothing": change})
    after, cpu_s = smooth_run(survey, smoothing_params(config))
    truth = survey.ground_truth
    closures = closure_metrics(after.closures, after.stamp_s, truth, [])
    return {
        "final": float(ate_rmse(after.estimate, truth)),
        "aligned": float(ate_aligned_rmse(after.estimate, truth)),
        "nees": float(nees(after.estimate, after.estimate_covariance, truth)[0]),
        "wrong": closures["closures_wrong"] or 0,
        "cpu_s": cpu_s,
    }


def _row(change: dict[str, float], k: int, errors: dict[str, Any]) -> dict[str, Any]:
    name, value = next(iter(change.items()), ("defaults", None))
    row: dict[str, Any] = {"parameter": f"{name}: {value:g}" if change else name}
    for measure in ("final", "aligned", "nees"):
        for case, surveys in errors.items():
            of_default = [s[0][measure] if change and measure != "nees" else 1.0 for s in surveys]
            values = [s[k][measure] / other for s, other in zip(surveys, of_default)]
            row[f"{measure}, {case}"] = float(np.median(values))
    every = [survey[k] for surveys in errors.values() for survey in surveys]
    row["wrong"] = sum(one["wrong"] for one in every)
    row["CPU, s"] = float(np.median([one["cpu_s"] for one in every]))
    return row
