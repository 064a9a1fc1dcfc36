"""The command line of experiment.py."""

from __future__ import annotations

import argparse
import dataclasses
import signal
import sys
from pathlib import Path
from typing import Any, Sequence

import yaml

from rbpf_svgp_slam.experiments import ExperimentError
from rbpf_svgp_slam.experiments.figures import draw_experiment
from rbpf_svgp_slam.experiments.plan import Options, experiment
from rbpf_svgp_slam.experiments.runner import run_experiment
from rbpf_svgp_slam.experiments.summary import read_rows, write_summary
from rbpf_svgp_slam.parameters.engines import ENGINES
from rbpf_svgp_slam.parameters.known import complaints, default_parameters

_DESCRIPTION = """Carry out one of the three experiments of Torroba et al. (2023) on a simulated
survey: exp1 mapping only, exp2 live beside another load, exp3 SLAM. DIR gets the survey, a run
folder for each configuration (J particles, B map nodes), and summary.md with the paper's numbers
beside ours. A run that is already there is kept."""


def main(argv: Sequence[str] | None = None) -> int:
    """Carry out an experiment; returns the exit status: 2 for a mistake, 130 if interrupted."""
    arguments = _parse(argv)
    # Both, also where a script in the background has had SIGINT ignored: roslaunch must be told.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)
    try:
        plan = experiment(arguments.experiment)
        if arguments.offline:
            plan = dataclasses.replace(plan, live=False, other_load=0.0)
        options = Options(
            scale=arguments.scale,
            seed=arguments.seed,
            engines=tuple(arguments.engines),
            optimizer=arguments.optimizer,
            rate=arguments.rate,
            overlay=_overlay(arguments.config),
            only=tuple(arguments.only),
        )
        out_dir = arguments.out.resolve()
        folders = run_experiment(plan, options, out_dir)
        rows = read_rows(plan, folders)
        print(write_summary(plan, rows, draw_experiment(plan, rows, out_dir), out_dir))
    except (ExperimentError, OSError, ValueError) as error:
        print(f"experiment.py: error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("experiment.py: interrupted; the same command goes on from here", file=sys.stderr)
        return 130
    return 0


def _parse(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="experiment.py", description=_DESCRIPTION)
    add = parser.add_argument
    add("experiment", metavar="exp1|exp2|exp3")
    add("--out", required=True, type=Path, metavar="DIR")
    add(
        "--scale",
        type=float,
        default=1.0,
        help="of the survey: its lines shorter by sqrt(f), at least two of them (default 1)",
    )
    add("--seed", type=int, default=1, help="of survey and filter (default 1)")
    add(
        "--engines",
        nargs="+",
        default=["svgp"],
        choices=tuple(ENGINES),
        help="of the maps: configurations of others are left out (default svgp)",
    )
    add(
        "--optimizer",
        default="streaming",
        choices=("streaming", "adam", "natgrad"),
        help="svgp/optimizer (default streaming; the paper's is adam)",
    )
    add("--rate", type=float, default=1.0, help="of exp2, times real time (default 1)")
    add(
        "--offline",
        action="store_true",
        help="read exp2's survey directly, too: the result does not depend on the machine",
    )
    add("--only", nargs="+", default=[], metavar="NAME", help="configurations, such as J10_B1")
    add("--config", type=Path, metavar="F.yaml", help="parameters to be set over the experiment's")
    return parser.parse_args(argv)


def _overlay(path: Path | None) -> dict[str, Any]:
    if path is None:
        return {}
    try:
        overlay = yaml.safe_load(path.read_text())
    except yaml.YAMLError as error:
        raise ExperimentError(f"{path}: expected a yaml file ({error})") from error
    if not isinstance(overlay, dict):
        raise ExperimentError(f"{path}: expected parameters by name, as in config/default.yaml")
    # The nodes check the values; a name that is wrong should not cost a simulation first.
    for complaint in complaints(overlay, default_parameters()):
        raise ExperimentError(f"{path}: {complaint}")
    return overlay
