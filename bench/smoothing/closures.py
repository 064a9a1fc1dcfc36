"""What smoothing makes of dead reckoning alone, beside the ideal smoother, over seeds and seabeds.

closures.md has a table of medians and one of every survey. A survey takes some seconds; those that
closures.jsonl has already from this build are not smoothed again. Of the environment,
CLOSURE_SEEDS (10), CLOSURE_SCALE (0.64 of lolo3: some 22 minutes of survey) and CLOSURE_SEABEDS
(all, the first so many) make it shorter; CLOSURE_MISSION is another mission than lolo3.
"""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from bench.smoothing import simulated_runs
from bench.svgp.in_process import markdown
from rbpf_svgp_slam import _smoothing
from rbpf_svgp_slam.metrics.closure_metrics import closure_errors, closure_metrics
from rbpf_svgp_slam.metrics.ideal_metrics import ideal_metrics
from rbpf_svgp_slam.metrics.normalised_errors import nees
from rbpf_svgp_slam.metrics.trajectory_errors import ate_aligned_rmse, ate_rmse
from rbpf_svgp_slam.nested import merged
from rbpf_svgp_slam.run.survey_run import SurveyRun
from rbpf_svgp_slam.smoothing.smooth_run import smooth_run
from rbpf_svgp_slam.smoothing.smoothing_parameters import smoothing_params

FIRST_SEED = 101  # nothing was chosen on these
VERDICTS = "flat ambiguous bad_fit little_overlap".split()


def run(out: Path) -> dict[str, Any]:
    """Medians over the seeds by seabed, and every survey's row."""
    seeds = int(os.environ.get("CLOSURE_SEEDS", "10"))
    scale = float(os.environ.get("CLOSURE_SCALE", "0.64"))
    mission = os.environ.get("CLOSURE_MISSION", simulated_runs.MISSION)
    seabeds = list(simulated_runs.SEABEDS)
    seabeds = seabeds[: int(os.environ.get("CLOSURE_SEABEDS", len(seabeds)))]
    store = Rows(out / "closures.jsonl")
    rows: dict[str, list[dict[str, Any]]] = {}
    for seabed in seabeds:
        if seabed == "block_b" and not simulated_runs.REAL_SEABED.exists():
            print(f"{seabed}: {simulated_runs.REAL_SEABED} is not there: left out", flush=True)
            continue
        rows[seabed] = [
            store.row(seabed, seed, scale, mission)
            for seed in range(FIRST_SEED, FIRST_SEED + seeds)
        ]
    medians = {seabed: summary(of_seabed) for seabed, of_seabed in rows.items()}
    overview = markdown([{"seabed": seabed, **shown(row)} for seabed, row in medians.items()])
    every = markdown([shown_survey(row) for of_seabed in rows.values() for row in of_seabed])
    (out / "closures.md").write_text(f"{overview}\n\n{every}\n", encoding="utf-8")
    print(overview, flush=True)
    return {"closures": medians}


class Rows:
    """Rows that are kept in a file, so that an interrupted run goes on where it was."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._build = _build()
        lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
        self._known = {self._key(row): row for row in map(json.loads, lines)}

    def row(self, seabed: str, seed: int, scale: float, mission: str) -> dict[str, Any]:
        """Return the survey's row, measured now unless this build of the smoother has done so."""
        asked = {
            "build": self._build,
            "mission": mission,
            "seabed": seabed,
            "seed": seed,
            "scale": scale,
        }
        known = self._known.get(self._key(asked))
        if known is not None:
            return known
        survey = simulated_runs.simulated_run(seabed, seed, scale, mission)
        row = {**asked, **score(survey), **_ideals(survey)}
        print(f"{seabed}, seed {seed}: {json.dumps(shown_survey(row))}", flush=True)
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")
        return row

    @staticmethod
    def _key(row: dict[str, Any]) -> tuple:
        return tuple(row[name] for name in ("build", "mission", "seabed", "seed", "scale"))


def _build() -> str:
    """A number that changes when the smoother is built from other sources."""
    maps = Path("/proc/self/maps").read_text(encoding="utf-8")
    paths = {line.split()[-1] for line in maps.splitlines() if "librbpf_core" in line}
    contents = b"".join(Path(path).read_bytes() for path in [_smoothing.__file__, *sorted(paths)])
    return hashlib.sha256(contents).hexdigest()[:16]


def score(before: SurveyRun, change: dict[str, float] | None = None) -> dict[str, Any]:
    """Errors of one survey's dead reckoning, smoothed with the change, and of its closures."""
    config = merged(before.config, {"smoothing": change or {}})
    after, cpu_s = smooth_run(before, smoothing_params(config))
    truth = before.ground_truth
    closures = closure_metrics(after.closures, after.stamp_s, truth, [])
    refused = closures["closures_refused"]
    return {
        "dr_ate_m": ate_rmse(before.estimate, truth),
        "ate_m": ate_rmse(after.estimate, truth),
        "dr_aligned_m": ate_aligned_rmse(before.estimate, truth),
        "aligned_m": ate_aligned_rmse(after.estimate, truth),
        "accepted": closures["closures_accepted"],
        **{verdict: refused.get(verdict, 0) for verdict in VERDICTS},
        "wrong": closures["closures_wrong"],
        "closure_error_m": _number(closures["closure_error_median_m"]),
        "closure_yaw_error_mrad": _yaw_error_mrad(after),
        "closure_nees": _number(closures["closure_nees"]),
        "nees": nees(after.estimate, after.estimate_covariance, truth)[0],
        "cpu_s": cpu_s,
    }


def _ideals(before: SurveyRun) -> dict[str, Any]:
    ideal = ideal_metrics(before, [])
    return {
        "ideal_ate_m": ideal["ideal_ate_rmse_m"],
        "ideal_aligned_m": ideal["ideal_ate_aligned_rmse_m"],
        "ideal_online_m": ideal["ideal_online_ate_rmse_m"],
    }


def _yaw_error_mrad(run: SurveyRun) -> float | None:
    """Of the accepted closures, root mean square."""
    error, _ = closure_errors(run.closures, run.stamp_s, run.ground_truth)
    yaw_rad = error[run.closures.verdict == "accepted", 2]
    return 1e3 * float(np.sqrt(np.mean(yaw_rad**2))) if len(yaw_rad) else None


def _number(value: Any) -> float | None:
    return None if value is None else float(value)


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Medians over the surveys of one seabed; counts of wrong closures over all of them."""

    def median(name: str) -> float | None:
        values = [row[name] for row in rows if row[name] is not None]
        return float(np.median(values)) if values else None

    def ratios(name: str, other: str) -> list[float]:
        return [row[name] / row[other] for row in rows]

    names = [
        n for n in rows[0] if n not in ("build", "mission", "seabed", "seed", "scale", "wrong")
    ]
    accepted = sum(row["accepted"] for row in rows)
    wrong = sum(row["wrong"] or 0 for row in rows)
    return {
        "surveys": len(rows),
        **{name: median(name) for name in names},
        "over_ideal": float(np.median(ratios("ate_m", "ideal_ate_m"))),
        "over_dr_worst": max(ratios("ate_m", "dr_ate_m")),
        "wrong_percent": 100.0 * wrong / accepted if accepted else None,
    }


def shown(row: dict[str, Any]) -> dict[str, Any]:
    """The columns of the overview's table."""
    return {
        **_errors(row),
        "over ideal": row["over_ideal"],
        "worst over DR": row["over_dr_worst"],
        **_counts(row),
        "wrong, %": row["wrong_percent"],
        **_quality(row),
    }


def shown_survey(row: dict[str, Any]) -> dict[str, Any]:
    """The columns of one survey."""
    return {
        "seabed": row["seabed"],
        "seed": row["seed"],
        **_errors(row),
        "over DR": row["ate_m"] / row["dr_ate_m"],
        **_counts(row),
        "wrong": row["wrong"],
        **_quality(row),
    }


def _errors(row: dict[str, Any]) -> dict[str, Any]:
    return {
        "DR, m": row["dr_ate_m"],
        "smoothed, m": row["ate_m"],
        "ideal, m": row["ideal_ate_m"],
        "DR aligned": row["dr_aligned_m"],
        "smoothed aligned": row["aligned_m"],
        "ideal aligned": row["ideal_aligned_m"],
    }


def _counts(row: dict[str, Any]) -> dict[str, Any]:
    return {"accepted": row["accepted"], **{v.replace("_", " "): row[v] for v in VERDICTS}}


def _quality(row: dict[str, Any]) -> dict[str, Any]:
    return {
        "closure error, m": row["closure_error_m"],
        "closure yaw error, mrad": row["closure_yaw_error_mrad"],
        "closure NEES": row["closure_nees"],
        "NEES": row["nees"],
        "CPU, s": row["cpu_s"],
    }
