"""The command line that smooths the past of a run folder, ours or another program's."""

from __future__ import annotations

import argparse
import dataclasses
import sys
from pathlib import Path
from typing import Any

import yaml

from rbpf_svgp_slam.evaluation.evaluate_run import load_folder
from rbpf_svgp_slam.evaluation.report import write_report
from rbpf_svgp_slam.exports.after_run import export_after_run
from rbpf_svgp_slam.metrics.trajectory_errors import ate_rmse
from rbpf_svgp_slam.nested import merged
from rbpf_svgp_slam.parameters.known import complaints, default_parameters
from rbpf_svgp_slam.run.run_files import load_run, save_run
from rbpf_svgp_slam.run.survey_run import SurveyRun
from rbpf_svgp_slam.smoothing.smooth_run import smooth_run
from rbpf_svgp_slam.smoothing.smoothing_parameters import smoothing_params

_DESCRIPTION = """Adjust the track of a survey that is over by what its passes tell each other.

Windows of pings are laid on small maps of older passes, and a pose graph brings dead reckoning and
what they tell together: docs/closures.md. Nothing but dead reckoning, beams and fixes of the run
folder is used, not its trajectory nor its ground truth. DIR may be another program's:
evaluate_run.py --help tells what it holds. The folder OUT is a run folder, too: trajectory.tum with
covariances, closures.npz, map.npz and seabed.npz of the adjusted track, report.json and
report.html; with a survey_origin, export/ too, as export_map.py writes it. In DIR nothing is
changed."""

#: What report.json says of the survey; the rest of it was about the run that is adjusted.
_OF_SURVEY = (
    "terrain pings_dropped refused findings ground_truth_refused velocity_source odometry_gaps "
    "provenance"
).split()
#: In the report of an adjusted run: the folder that it is made of.
_MARK = "smoothed_from"


def main(argv: list[str] | None = None) -> int:
    """Run the command; return its exit status: 0 adjusted, 2 bad input."""
    arguments = _parse(argv)
    try:
        _run(arguments)
    except (ValueError, OSError) as error:
        _complain(" ".join(str(error).split()))
        return 2
    return 0


def _complain(text: str) -> None:
    print(f"smooth_survey.py: error: {text}", file=sys.stderr)


def _parse(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="smooth_survey.py",
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("folder", metavar="DIR", type=Path, help="the run folder")
    add("--out", metavar="OUT", type=Path, help="the folder to write (default: DIR/smoothed)")
    config = "parameters to be set over those of DIR/parameters.yaml: motion, start, smoothing"
    add("--config", metavar="F.yaml", type=Path, nargs="+", default=[], help=config)
    return parser.parse_args(argv)


def _run(arguments: argparse.Namespace) -> None:
    folder = arguments.folder
    out_dir = arguments.out or folder / "smoothed"
    overlays = [_overlay(path) for path in arguments.config]
    run = _load(folder)
    _refuse_to_overwrite(out_dir, folder)
    config = run.config
    for overlay in overlays:
        config = merged(config, overlay)
    try:
        params = smoothing_params(config)
        smoothed, cpu_s = smooth_run(dataclasses.replace(run, config=config), params)
    except ValueError as error:
        where = f"{folder}/parameters.yaml or --config" if "/" in str(error) else str(folder)
        raise ValueError(f"{where}: {error}") from error
    statistics = {name: run.statistics[name] for name in _OF_SURVEY if name in run.statistics}
    statistics.update({_MARK: str(folder.resolve()), "smoothing_cpu_s": cpu_s})
    report = _write(dataclasses.replace(smoothed, statistics=statistics), out_dir)
    export_after_run(out_dir, config, _complain)
    print(_summary(run, report, cpu_s))
    print(f"Report: {(out_dir / 'report.html').resolve()}")


def _load(folder: Path) -> SurveyRun:
    if folder.is_dir() and not (folder / "survey.npz").is_file():
        raise ValueError(
            f"{folder}/survey.npz: no such file; expected the beams of the survey, as "
            "evaluate_run.py --help tells"
        )
    return load_folder(folder)


def _overlay(path: Path) -> dict[str, Any]:
    try:
        overlay = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: expected a yaml file ({error})") from error
    if not isinstance(overlay, dict):
        raise ValueError(f"{path}: expected parameters by name, as in config/default.yaml")
    for complaint in complaints(overlay, default_parameters()):
        raise ValueError(f"{path}: {complaint}")
    return overlay


def _refuse_to_overwrite(out_dir: Path, folder: Path) -> None:
    """What was there before is kept, unless this command has made it."""
    if not (out_dir / "trajectory.tum").exists():
        return
    if out_dir.resolve() != folder.resolve() and _MARK in _report_of(out_dir):
        return
    raise ValueError(f"{out_dir}: has a run already, which is kept; expected another folder")


def _report_of(folder: Path) -> str:
    path = folder / "report.json"
    return path.read_text(encoding="utf-8") if path.is_file() else ""


def _write(run: SurveyRun, out_dir: Path) -> dict[str, Any]:
    """The run folder, with the seabed of the adjusted track for the map; returns the report."""
    run = dataclasses.replace(run, status_history={}, time_lapse=None)
    if run.seabed is not None:
        run = dataclasses.replace(
            run,
            map=run.seabed,
            noise_variance_m2=run.seabed_map.noise_variance_m2,
            stored_map=None,
        )
    save_run(run, out_dir)
    # As evaluate_run.py will find it; what a former report.json says is no matter.
    again = load_run(out_dir)
    again = dataclasses.replace(again, statistics=run.statistics, terrain=run.terrain)
    return write_report(again, out_dir)


def _summary(run: SurveyRun, report: dict[str, Any], cpu_s: float) -> str:
    refused = report["closures_refused"]
    counted = ", ".join(f"{count} {verdict}" for verdict, count in sorted(refused.items()))
    parts = [f"{report['closures_accepted']} closures accepted; {counted or 'none'} refused"]
    if report["closures_wrong"] is not None:
        parts[0] += f"; {report['closures_wrong']} wrong"
    if report["ate_rmse_m"] is not None:
        before = _metres(ate_rmse(run.estimate, run.ground_truth))
        parts.append(
            f"ATE {before} before, {_metres(report['ate_rmse_m'])} after "
            f"(DR {_metres(report['dr_ate_rmse_m'])}, ideal {_metres(report['ideal_ate_rmse_m'])})"
        )
    return ". ".join([*parts, f"{cpu_s:.1f} s of one processor."])


def _metres(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.2f} m"
