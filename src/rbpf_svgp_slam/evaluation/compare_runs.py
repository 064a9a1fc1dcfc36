"""The command line that lays the reports of several runs side by side."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import yaml
from matplotlib.figure import Figure

from rbpf_svgp_slam.evaluation.numbers import format_number
from rbpf_svgp_slam.figures import figure_style as style
from rbpf_svgp_slam.metrics import metric_names
from rbpf_svgp_slam.metrics.trajectory_errors import position_error
from rbpf_svgp_slam.nested import flatten
from rbpf_svgp_slam.run.run_files import load_tracks

_DESCRIPTION = """Lay the reports of several runs side by side, as a table in Markdown.

Rows are the parameters that differ between the runs, then the counters and metrics of report.json;
the lowest of each error is bold, if the runs are of one survey. A folder without report.json is
scored first: evaluate_run.py DIR --rewrite."""

_RUN_COLOURS = [c for c in style.CURVE_COLOURS if c != style.COLOURS["dead_reckoning"]]
_MIN_WIDTH, _MAX_WIDTH = 3, 48  # of the table's columns, characters


@dataclass
class ComparedRun:
    """What the table shows of a run."""

    folder: Path
    name: str  # the end of the folder's path that no other run's has
    report: dict[str, Any]
    parameters: dict[str, str]  # by slash/separated/name; empty where not known


def main(argv: list[str] | None = None) -> int:
    """Run the command; return its exit status: 2 for a mistake in the arguments or folders."""
    arguments = _parse(argv)
    try:
        runs = load_runs(arguments.folders)
        text = compare(runs)
        print(text)
        if arguments.out:
            arguments.out.write_text(text + "\n", encoding="utf-8")
        if arguments.figure:
            _save_figure(runs, arguments.figure)
    except (ValueError, OSError) as error:
        print(f"compare_runs.py: error: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    return 0


def _parse(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="compare_runs.py",
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("folders", metavar="DIR", nargs="+", type=Path, help="run folders, two or more")
    add("--out", metavar="F.md", type=Path, help="write the table to F.md too")
    figure = "draw the position error over time, where there is ground truth (png, pdf, svg)"
    add("--figure", metavar="F.png", type=Path, help=figure)
    return parser.parse_args(argv)


def load_runs(folders: list[Path]) -> list[ComparedRun]:
    """The runs in the given folders; raises ValueError that names what is missing or damaged."""
    if len({folder.resolve() for folder in folders}) < max(2, len(folders)):
        given = ", ".join(map(str, folders))
        raise ValueError(f"expected two run folders or more, all different, got {given}")
    runs = []
    for folder, name in zip(folders, short_names(folders)):
        if not folder.is_dir():
            raise ValueError(f"{folder}: no such folder")
        report = folder / "report.json"
        if not report.is_file():
            raise ValueError(f"{report}: no such file; evaluate_run.py --rewrite writes it")
        parameters = folder / "parameters.yaml"
        known = _load(parameters, yaml.safe_load) if parameters.is_file() else {}
        runs.append(ComparedRun(folder, name, _load(report, json.loads), _texts(known)))
    return runs


def _texts(parameters: dict[str, Any]) -> dict[str, str]:
    """Parameters by slash/separated/name, as they are printed."""
    return {name: str(value) for name, value in flatten(parameters)}


def short_names(folders: list[Path]) -> list[str]:
    """The shortest end of each folder's path that no other folder's path ends with."""
    parts = [folder.resolve().parts for folder in folders]
    names = []
    for own in parts:
        length = 1
        while length < len(own) and sum(p[-length:] == own[-length:] for p in parts) > 1:
            length += 1
        names.append("/".join(own[-length:]))
    return names


def _load(path: Path, parse: Callable[[str], Any]) -> dict[str, Any]:
    try:
        values = parse(path.read_text(encoding="utf-8"))
    except (ValueError, yaml.YAMLError) as error:
        raise ValueError(f"{path}: expected names and values ({error})") from error
    if not isinstance(values, dict):
        raise ValueError(f"{path}: expected names and values, got {type(values).__name__}")
    return values


def compare(runs: list[ComparedRun]) -> str:
    """The table in Markdown, one column a run, below it a warning if the surveys differ."""
    settings = _differing_settings(runs)
    rows = [["", *(run.name for run in runs)]]
    rows += [[name, *(run.parameters.get(name, "–") for run in runs)] for name in settings]
    warning = _survey_warning(runs)
    metrics = [name for name in _reported(runs) if name not in settings]
    rows += [_metric_row(name, runs, may_be_best=not warning) for name in metrics]
    text = _markdown(rows)
    return f"{text}\n\n{warning}" if warning else text


def _differing_settings(runs: list[ComparedRun]) -> list[str]:
    """Parameters in which runs differ; a run without parameters.yaml says nothing about them."""
    known = [run.parameters for run in runs if run.parameters]
    names = dict.fromkeys(name for parameters in known for name in parameters)
    return [name for name in names if len({p.get(name) for p in known}) > 1]


def _reported(runs: list[ComparedRun]) -> list[str]:
    """Counters and metrics that one of the runs has at least, those we do not know of last."""
    ours = [*metric_names.COUNTERS, *metric_names.METRICS]
    others = dict.fromkeys(
        name
        for run in runs
        for name, value in run.report.items()
        if name not in ours and _is_number(value)
    )
    return [
        name for name in [*ours, *others] if any(run.report.get(name) is not None for run in runs)
    ]


def _metric_row(name: str, runs: list[ComparedRun], may_be_best: bool) -> list[str]:
    """A row of the table; of an error the lowest may be bold, and what reads the same."""
    values = [run.report.get(name) for run in runs]
    texts = [format_number(value) for value in values]
    numbers = [value for value in values if _is_number(value)]
    if may_be_best and name in metric_names.ERRORS and len(set(map(format_number, numbers))) > 1:
        best = format_number(min(numbers))
        texts = [f"**{text}**" if text == best else text for text in texts]
    return [name, *texts]


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _markdown(rows: list[list[str]]) -> str:
    """Rows, the first of them the header, padded so that the text itself can be read."""
    rows = [[cell.replace("|", "\\|").replace("\n", " ") for cell in row] for row in rows]
    # A polygon is let stick out of its column, rather than make all of them as wide.
    widths = [max(_MIN_WIDTH, *(n for n in map(len, c) if n < _MAX_WIDTH)) for c in zip(*rows)]
    lines = [
        [row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:]))]
        for row in rows
    ]
    lines.insert(1, ["-" * widths[0], *("-" * (width - 1) + ":" for width in widths[1:])])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _survey_warning(runs: list[ComparedRun]) -> str | None:
    """Pings and beams are the survey's: where they differ, errors are not of the same task.

    No beams are those of a run of which only the trajectories are there.
    """
    differing = [
        f"{name} {', '.join(format_number(run.report.get(name)) for run in runs)}"
        for name in ("pings", "beams")
        if len({run.report.get(name) for run in runs} - {None, 0}) > 1
    ]
    if not differing:
        return None
    return f"Warning: these are not runs of the same survey ({'; '.join(differing)})."


def _save_figure(runs: list[ComparedRun], path: Path) -> None:
    with matplotlib.rc_context(style.STYLE):
        figure, left_out = draw_position_errors(runs)
        figure.savefig(path)
    for name in left_out:
        print(
            f"compare_runs.py: {name} has no ground truth, left out of the figure", file=sys.stderr
        )


def draw_position_errors(runs: list[ComparedRun]) -> tuple[Figure, list[str]]:
    """Draw the runs' 3-D position errors in m over time, and the first one's dead reckoning's.

    Returns the figure, and the names of the runs that have no ground truth. Raises ValueError
    where none has any.
    """
    figure = Figure(figsize=(style.WIDTH_IN, 3.8))
    axes = figure.add_subplot()
    left_out = []
    for i, run in enumerate(runs):
        tracks = load_tracks(run.folder)
        if tracks.ground_truth is None or not np.isfinite(tracks.ground_truth).any():
            left_out.append(run.name)
            continue
        minutes = style.minutes_since_start(tracks, tracks.stamp_s)
        drawn = [(tracks.estimate, run.name, _RUN_COLOURS[i % len(_RUN_COLOURS)])]
        if not axes.lines and np.isfinite(tracks.dead_reckoning).any():
            colour = style.COLOURS["dead_reckoning"]
            drawn.insert(0, (tracks.dead_reckoning, f"dead reckoning of {run.name}", colour))
        for poses, label, colour in drawn:
            error_m = np.linalg.norm(position_error(poses, tracks.ground_truth), axis=1)
            axes.plot(minutes, error_m, color=colour, label=label)
    if not axes.lines:
        raise ValueError("no run has ground truth: expected ground_truth.tum, to draw the errors")
    axes.set(xlabel="time (min)", ylabel="error (m)", title="Position error", ylim=(0, None))
    axes.legend(**{**style.LEGEND_ABOVE, "ncol": min(len(runs) + 1, 4)})
    return figure, left_out
