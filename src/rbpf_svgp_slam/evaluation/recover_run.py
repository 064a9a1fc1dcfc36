"""The command line that makes the run folder of a survey whose end nobody has written down."""

from __future__ import annotations

import argparse
import dataclasses
import sys
import xmlrpc.client
from pathlib import Path
from typing import Any

import numpy as np

from rbpf_svgp_slam import _journal
from rbpf_svgp_slam.evaluation.report import write_report
from rbpf_svgp_slam.exports.after_run import export_after_run
from rbpf_svgp_slam.protocol import names
from rbpf_svgp_slam.run.fixes import Fixes
from rbpf_svgp_slam.run.run_files import load_run, save_run
from rbpf_svgp_slam.run.survey_run import GridMap, SurveyRun
from rbpf_svgp_slam.run.tracks import GROUND_TRUTH_GAP_S, interpolate_poses, read_tum
from rbpf_svgp_slam.survey_area.grid import cell_centres

_DESCRIPTION = """Make the run folder of a survey that was interrupted, from its journal.

DIR/survey.journal, which the live core keeps where slam.launch or replay.launch have out:=DIR, is
read as far as it is whole. DIR gets trajectory.tum, online.tum, dead_reckoning.tum, survey.npz,
parameters.yaml, report.json and report.html, and for a map the seabed that the whole track gives:
the particles' own maps are lost. DIR/ground_truth.tum, if it is there, is taken to score the track.
The journal stays as it is: the survey can still be resumed, by slam.launch resume:=DIR."""

#: In the report of a recovered run: the journal that it is made of. Such a run may be made again.
_MARK = "recovered_from"


def main(argv: list[str] | None = None) -> int:
    """Run the command; return its exit status: 0 written, 2 bad input."""
    parser = argparse.ArgumentParser(
        prog="recover_run.py",
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("folder", metavar="DIR", type=Path, help="the run folder")
    parser.add_argument("--out", metavar="OUT", type=Path, help="the folder to write, if not DIR")
    given = parser.parse_args(argv)
    try:
        print(recover(given.folder, given.out or given.folder))
    except (ValueError, OSError, RuntimeError) as error:
        _complain(str(error))
        return 2
    return 0


def recover(folder: Path, out_dir: Path) -> str:
    """Write the run folder; returns what is to be told.

    Raises RuntimeError where there is no journal that can be read, ValueError where it holds no
    ping or the folder has a run already.
    """
    journal = folder / names.JOURNAL
    _refuse_to_overwrite(out_dir)
    survey = _journal.read(str(journal))
    run = _run(survey, journal, _ground_truth(folder / "ground_truth.tum", survey["stamp_s"]))
    out_dir.mkdir(parents=True, exist_ok=True)
    save_run(run, out_dir)
    again = dataclasses.replace(load_run(out_dir), statistics=run.statistics)
    write_report(again, out_dir)
    export_after_run(out_dir, run.config, _complain)
    lines = [f"{len(run.stamp_s)} pings from {survey['records']} records of {journal}"]
    if survey["lost_bytes"]:
        lines.append(_lost(survey))
    return "\n".join([*lines, f"Report: {(out_dir / 'report.html').resolve()}"])


def _run(survey: dict[str, Any], journal: Path, ground_truth: np.ndarray | None) -> SurveyRun:
    pings = len(survey["stamp_s"])
    if not pings:
        raise ValueError(f"{journal}: holds no ping; expected some of the survey")
    (config,), _ = xmlrpc.client.loads(_as_call(survey["settings"]))
    x, y = cell_centres(config["survey_area"], config["map"]["resolution_m"])
    nothing = GridMap(x, y, *np.full((2, len(x), len(y)), np.nan))
    run = SurveyRun(
        **{name: survey[name] for name in _ARRAYS},
        levelled=survey["levelled"].astype(float),
        ping_of_beam=np.repeat(np.arange(pings), survey["beams_per_ping"]),
        ground_truth=ground_truth,
        fixes=Fixes(**survey["fixes"]),
        map=nothing,
        predict=lambda xy: (np.full(len(xy), np.nan), np.full(len(xy), np.nan)),
        noise_variance_m2=np.nan,
        support_points=np.empty((0, 3)),
        statistics=_statistics(survey, journal, config),
        config=config,
    )
    if run.seabed is None:
        return run
    seabed, noise_variance_m2 = run.seabed, run.seabed_map.noise_variance_m2
    return dataclasses.replace(run, map=seabed, noise_variance_m2=noise_variance_m2)


_ARRAYS = (
    "stamp_s estimate estimate_covariance online online_covariance dead_reckoning held_out"
).split()


def _as_call(value: str) -> str:
    """The XML-RPC of a value, as what xmlrpc.client reads."""
    return f"<params><param>{value}</param></params>"


def _statistics(survey: dict[str, Any], journal: Path, config: dict[str, Any]) -> dict[str, Any]:
    stamp_s = survey["stamp_s"]
    return {
        _MARK: str(journal.resolve()),
        "particles": config["particles"],
        "nodes": config["nodes"],
        "seed": config["seed"],
        "pings": len(stamp_s),
        "beams": len(survey["levelled"]),
        "duration_s": float(stamp_s[-1] - stamp_s[0]),
        "loop_closure_prompts": survey["prompts"],
        "resamplings": survey["resamplings"],
        "fixes": len(survey["fixes"]["stamp"]),
        "health": {
            "core_resumed": survey["programs"] - 1,
            "journal": _lost(survey) if survey["lost_bytes"] else "whole",
        },
    }


def _lost(survey: dict[str, Any]) -> str:
    return f"lost: the last {survey['lost_bytes']} bytes, {survey['why_lost']}"


def _ground_truth(path: Path, stamp_s: np.ndarray) -> np.ndarray | None:
    """Poses [P, 6] at the pings, NaN where none are near; none without a file."""
    if not path.is_file():
        return None
    return interpolate_poses(*read_tum(path), stamp_s, GROUND_TRUTH_GAP_S)


def _refuse_to_overwrite(out_dir: Path) -> None:
    report = out_dir / "report.json"
    if report.is_file() and _MARK not in report.read_text(encoding="utf-8"):
        raise ValueError(f"{out_dir}: has a run already, which is kept; expected another --out")


def _complain(text: str) -> None:
    print(f"recover_run.py: error: {text}", file=sys.stderr)
