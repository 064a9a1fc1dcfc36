"""What each parameter of the smoothing is worth: half and twice its default, beside the default.

From dead reckoning alone, on seeds that the study's tables do not use. defaults.md has, for each
value, the errors over those that the default leaves, 1.1 being a tenth worse: by case the median of
its seeds, over all surveys the geometric mean; and the median NEES, how many surveys have one above
2, and the worst survey's final error over that of its dead reckoning. In the environment
DEFAULT_SEEDS (2) makes it shorter, and DEFAULT_PARAMETERS, names apart by blanks, leaves out all
others.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import gmean

from bench.smoothing.closures import score
from bench.smoothing.simulated_runs import REAL_SEABED, as_run
from bench.study.cases import cases
from bench.svgp.in_process import markdown

#: Of each case, of each seed, by each change: what closures.score returns.
Scores = dict[str, list[list[dict[str, Any]]]]

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
    seeds = range(FIRST_SEED, FIRST_SEED + int(os.environ.get("DEFAULT_SEEDS", "2")))
    chosen = [name for name in CASES if name != "block_b" or REAL_SEABED.exists()]
    parameters = os.environ.get("DEFAULT_PARAMETERS", " ".join(VALUES)).split()
    changes = [{}] + [{name: v} for name in parameters for v in VALUES[name]]
    scores: Scores = {name: [] for name in chosen}
    for name, seed in ((name, seed) for seed in seeds for name in chosen):
        survey = as_run(cases([name])[0].survey(seed))
        scores[name].append([score(survey, change) for change in changes])
        print(f"{name}, seed {seed}: {scores[name][-1][0]}", flush=True)
    rows = [_row(change, k, scores) for k, change in enumerate(changes)]
    table = markdown(rows)
    (out / "defaults.md").write_text(table + "\n", encoding="utf-8")
    print(table, flush=True)
    return {"defaults": {row["parameter"]: row for row in rows}}


def _row(change: dict[str, float], k: int, scores: Scores) -> dict[str, Any]:
    name, value = next(iter(change.items()), ("defaults", None))
    row: dict[str, Any] = {"parameter": f"{name}: {value:g}" if change else name}
    for measure, label in (("ate_m", "final"), ("aligned_m", "aligned")):
        of_all: list[float] = []
        for case, surveys in scores.items():
            errors = [of_survey[k][measure] for of_survey in surveys]
            ratios = np.divide(errors, [of_survey[0][measure] for of_survey in surveys])
            row[f"{label}, {case}"] = float(np.median(ratios if change else errors))
            of_all.extend(ratios)
        row[label] = float(gmean(of_all))
    every = [of_survey[k] for surveys in scores.values() for of_survey in surveys]
    row["NEES"] = float(np.median([one["nees"] for one in every]))
    row["NEES above 2"] = sum(one["nees"] > 2.0 for one in every)
    row["worst final over DR"] = max(one["ate_m"] / one["dr_ate_m"] for one in every)
    row["wrong"] = sum(one["wrong"] or 0 for one in every)
    row["CPU, s"] = float(np.median([one["cpu_s"] for one in every]))
    return row
