"""The command line that scores a run folder anew, ours or another program's."""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

from rbpf_svgp_slam.evaluation.report import write_report
from rbpf_svgp_slam.metrics import metric_names
from rbpf_svgp_slam.metrics.evaluation import evaluate, json_ready
from rbpf_svgp_slam.metrics.evo_errors import evo_errors
from rbpf_svgp_slam.run.run_files import load_run, load_tracks
from rbpf_svgp_slam.run.survey_run import SurveyRun

_DESCRIPTION = """Compute all metrics of a run folder anew, and its trajectory errors by evo.

Prints each metric as report.json has it, as recomputed, and as evo has it. The exit status is 0 if
all agree, 1 if some do not, 2 if the folder cannot be read.

A folder of another program is scored too. Without alignment, in one frame map, z up, it holds:
  trajectory.tum      one pose a ping: stamp x y z qx qy qz qw (s, m), matched to within 1 us
  dead_reckoning.tum  the same, by dead reckoning
  ground_truth.tum    the same, where it is known; optional
  online.tum          the same, as estimated when the ping came; optional
  map.npz             x [nx], y [ny] cell centres in m, increasing; mean [nx, ny] of the seabed's z
                      in m, variance [nx, ny] of it in m2, NaN where unknown; noise_variance_m2,
                      optional, of a beam
  survey.npz          stamp_s [P] of the pings; held_out [P] bool, pings that the map has not been
                      made from; beams_per_ping [P]; levelled [N, 3] beams in ping order, float32 m:
                      x forward and y left of base_link with roll and pitch taken out, z in map;
                      optional estimate_covariance, online_covariance [P, 6] of the two estimates:
                      xx, xy, x yaw, yy, y yaw, yaw yaw (m2, m rad, rad2)
  closures.npz        loop closures, arrays as the fields of Closure.msg; optional
  fixes.npz           absolute positions, arrays as the fields of Fix.msg; optional
  report.json, parameters.yaml, history.npz   optional
Without survey.npz the trajectories alone are scored: trajectory.tum and ground_truth.tum, and
dead_reckoning.tum and online.tum if they are there; their stamps may differ, poses are
interpolated."""

# Two programs' sums over the same doubles; 1e-9 m, a TUM file's last digit, for errors of zero.
_EVO_TOLERANCE = {"rel_tol": 1e-6, "abs_tol": 1e-9}
# The folder keeps beams in float32 and poses with nine decimals: a beam at the edge of a cell may
# change cell, which moves a metric over cells by about its share of the beams.
_REPORT_TOLERANCE = {"rel_tol": 1e-3, "abs_tol": 1e-9}

#: Said where evo cannot be imported.
NO_EVO = (
    "evo: not installed, so that its column is empty ({error}). tools/requirements.sh installs "
    "it; elsewhere: python3 -m pip install --no-deps evo==1.26.3"
)


def main(argv: list[str] | None = None) -> int:
    """Run the command; return its exit status: 0 all agree, 1 something does not, 2 bad input."""
    arguments = _parse(argv)
    try:
        return _run(arguments)
    except (ValueError, OSError) as error:
        text = " ".join(str(error).split())
        print(f"evaluate_run.py: error: {text}", file=sys.stderr)
        return 2


def _parse(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="evaluate_run.py",
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("folder", metavar="DIR", type=Path, help="the run folder")
    seabed = "the true seabed; by default where report.json says"
    add("--terrain", metavar="F.npz", type=Path, help=seabed)
    add("--rewrite", action="store_true", help="write report.json and report.html anew")
    add("--json", metavar="F", type=Path, help="write the metrics, and evo's as a group evo, to F")
    return parser.parse_args(argv)


def _run(arguments: argparse.Namespace) -> int:
    run = load_folder(arguments.folder, arguments.terrain)
    has_report = (arguments.folder / "report.json").is_file()
    stored = dict(run.statistics) if has_report else None
    run = _to_be_counted_anew(run, arguments.terrain)
    report = _score(run, arguments)
    evo, no_evo = None, None
    try:
        evo = evo_errors(run, report["rpe_delta_s"])
    except ImportError as error:
        no_evo = NO_EVO.format(error=error)
    if arguments.json:
        text = json.dumps(json_ready({**report, "evo": evo}), indent=2, allow_nan=False)
        arguments.json.write_text(text + "\n", encoding="utf-8")
    table = ScoreTable(stored, report, evo, scored_names(run))
    print(f"{arguments.folder}: {_describe(run)}\n\n{table.text()}\n")
    # Of trajectories alone the report's notes tell what everything else lacks.
    for note in [*(report["notes"] if has_survey(run) else ()), *_coverage_notes(run)]:
        print(f"Note: {note}.")
    print(no_evo or table.verdict_on_evo())
    print(table.verdict_on_report(arguments.rewrite))
    return 1 if table.evo_differs or (table.report_differs and not arguments.rewrite) else 0


def load_folder(folder: Path, terrain: Path | None = None) -> SurveyRun:
    """The run in a folder, its trajectories alone if there is no survey.npz.

    Raises ValueError, which RunFolderError is, naming what is missing or damaged.
    """
    if not folder.is_dir():
        raise ValueError(f"{folder}: no such folder")
    if terrain is not None and not terrain.is_file():
        raise ValueError(f"{terrain}: no such file; expected the true seabed")
    try:
        return _load(folder, terrain)
    # Besides the loader's own errors what numpy makes of arrays of a wrong type or shape.
    except (IndexError, KeyError, TypeError, ValueError) as error:
        where = "" if str(error).startswith(str(folder)) else f"{folder}: "
        raise ValueError(f"{where}{error}") from error


def _load(folder: Path, terrain: Path | None) -> SurveyRun:
    if (folder / "survey.npz").is_file():
        run = load_run(folder, terrain)
        if np.any(np.diff(run.stamp_s) < 0):
            raise ValueError(f"{folder}/survey.npz: stamp_s decreases; expected pings in order")
        return run
    run = load_tracks(folder)
    if run.ground_truth is None:
        raise ValueError(
            f"{folder}: neither survey.npz nor ground_truth.tum; expected the one to score maps "
            "and consistency, or the other to score trajectories"
        )
    return run


def has_survey(run: SurveyRun) -> bool:
    """Whether there is more to the run than trajectories."""
    return run.map.mean.size > 0


def scored_names(run: SurveyRun) -> list[str]:
    """The metrics and counters that the run's data tell."""
    if not has_survey(run):
        return ["duration_s", *metric_names.TRAJECTORY_METRICS]
    unknown = {"terrain_rmse_m", "seabed_terrain_rmse_m"} if run.terrain is None else set()
    names = (*metric_names.FROM_DATA, *metric_names.METRICS)
    return [name for name in names if name not in unknown]


def _to_be_counted_anew(run: SurveyRun, terrain: Path | None) -> SurveyRun:
    """The run without the counters that its data tell; with the terrain's place, if it is new."""
    kept = {k: v for k, v in run.statistics.items() if k not in metric_names.FROM_DATA}
    if terrain is not None:
        kept["terrain"] = str(terrain.resolve())
    return dataclasses.replace(run, statistics=kept)


def _score(run: SurveyRun, arguments: argparse.Namespace) -> dict[str, Any]:
    """The report, written to the folder if that is asked for."""
    if not arguments.rewrite:
        return evaluate(run).report
    if not has_survey(run):
        raise ValueError(
            f"{arguments.folder}/survey.npz: no such file; --rewrite needs the survey. "
            f"--json {arguments.folder}/report.json writes the trajectories' metrics alone"
        )
    return write_report(run, arguments.folder)


def _describe(run: SurveyRun) -> str:
    if not has_survey(run):
        return f"trajectories of {len(run.stamp_s)} poses; no survey.npz, so no map is scored"
    return f"{len(run.stamp_s)} pings with {len(run.levelled)} beams"


def _coverage_notes(run: SurveyRun) -> list[str]:
    """What the trajectories' files lack: metrics are over the other pings, in silence."""
    pings, notes = len(run.stamp_s), []
    tracks = {"trajectory": run.estimate, "dead_reckoning": run.dead_reckoning}
    if run.online is not None:
        tracks["online"] = run.online
    if not has_survey(run):
        tracks["ground_truth"] = run.ground_truth
    for name, poses in tracks.items():
        known = int(np.isfinite(poses).all(axis=1).sum())
        if known < pings:
            notes.append(f"{name}.tum has poses at the stamps of {known} of {pings} pings")
    path = run.statistics.get("terrain")
    if has_survey(run) and run.terrain is None and path:
        notes.append(f"{path}: no such file, so that terrain_rmse_m is not computed; see --terrain")
    return notes


class ScoreTable:
    """Each metric as report.json, the recomputation and evo have it."""

    def __init__(
        self,
        stored: dict[str, Any] | None,
        report: dict[str, Any],
        evo: dict[str, Any] | None,
        names: list[str],
    ) -> None:
        """stored: of report.json, None without one; evo: None where not installed."""
        self._stored, self._report, self._evo = stored, report, evo
        self._names = names
        self._by_evo = [name for name in names if name in (evo or {})]
        #: Metrics in which evo's value differs from ours.
        self.evo_differs = [
            name for name in self._by_evo if not _agree(report[name], evo[name], _EVO_TOLERANCE)
        ]
        # An older report.json lacks newer metrics: nothing to compare with.
        self._in_report = [name for name in names if name in (stored or {})]
        #: Metrics in which report.json's value differs from ours.
        self.report_differs = [
            name
            for name in self._in_report
            if not _agree(stored[name], report[name], _REPORT_TOLERANCE)
        ]

    def text(self) -> str:
        """The table, one line a metric; ≠ marks what differs."""
        rows = [("metric", "report.json", "recomputed", "evo", "")]
        for name in self._names:
            values = (source.get(name) for source in (self._stored or {}, self._report))
            differs = name in self.evo_differs or name in self.report_differs
            evo = _text(self._evo[name]) if name in self._by_evo else ""
            rows.append((name, *map(_text, values), evo, "≠" if differs else ""))
        widths = [max(map(len, column)) for column in zip(*rows)]
        lines = [
            "  ".join([row[0].ljust(widths[0])] + [c.rjust(w) for c, w in zip(row[1:], widths[1:])])
            for row in rows
        ]
        return "\n".join(line.rstrip() for line in lines)

    def verdict_on_evo(self) -> str:
        """One line: whether evo, which is installed, agrees."""
        if not self._by_evo:
            return "evo: no ground truth, no error to compare."
        tolerance = f"relative tolerance {_EVO_TOLERANCE['rel_tol']:g}"
        program = f"evo {self._evo['version']}"
        if self.evo_differs:
            return f"{program}: DIFFERS from ours in {', '.join(self.evo_differs)} ({tolerance})."
        return f"{program}: agrees with ours in all {len(self._by_evo)} errors ({tolerance})."

    def verdict_on_report(self, rewritten: bool) -> str:
        """One line: whether report.json agrees."""
        after = " It has been written anew." if rewritten else ""
        if self._stored is None:
            return f"report.json: there was none.{after}"
        tolerance = f"relative tolerance {_REPORT_TOLERANCE['rel_tol']:g}"
        if self.report_differs:
            names = ", ".join(self.report_differs)
            return f"report.json: DIFFERS from the recomputation in {names} ({tolerance}).{after}"
        count = f"{len(self._in_report)} numbers"
        return f"report.json: agrees with the recomputation in all {count} ({tolerance}).{after}"


def _agree(a: Any, b: Any, tolerance: dict[str, float]) -> bool:
    """Whether two values are both unknown, or numbers within the tolerance."""
    if a is None or b is None:
        return a is b
    if not all(isinstance(value, (int, float)) for value in (a, b)):
        return False
    return math.isclose(a, b, **tolerance)


def _text(value: Any) -> str:
    """A number to seven digits, so that what differs by more than evo's tolerance can be seen."""
    if value is None:
        return "–"
    return f"{value:.7g}" if isinstance(value, float) else str(value)
