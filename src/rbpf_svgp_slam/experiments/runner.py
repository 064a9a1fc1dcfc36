"""Simulates an experiment's survey and runs the filter on it, once for each configuration."""

from __future__ import annotations

import json
import re
import signal
import subprocess
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Iterator

import rosbag
import yaml

from rbpf_svgp_slam import machine
from rbpf_svgp_slam.experiments import ExperimentError
from rbpf_svgp_slam.experiments.load import busy_core
from rbpf_svgp_slam.experiments.plan import Configuration, Experiment, Options, run_parameters
from rbpf_svgp_slam.experiments.resources import Monitor
from rbpf_svgp_slam.nested import flatten

PACKAGE = "rbpf_svgp_slam"
RESOURCE_PERIOD_S = 5.0
PROGRESS_PERIOD_S = 60.0
SETTINGS, RESOURCES = "settings.json", "resources.npz"
_PROGRESS = ("replay ", "offline replay: ")  # how replay.launch's and offline.launch's lines begin


def run_experiment(plan: Experiment, options: Options, out_dir: Path) -> list[Path]:
    """Do what is still to be done in out_dir; returns the run folders.

    A run with the same settings that has its report is left as it is: an experiment that was
    interrupted goes on where it was. Another survey or other settings are refused, before anything
    is done: what took hours is not written over.
    """
    rows = _chosen(plan, options)
    out_dir.mkdir(parents=True, exist_ok=True)
    bag = _simulate(plan, options, out_dir)
    survey = yaml.safe_load(bag.with_suffix(".survey.yaml").read_text())
    duration_s = _duration_s(bag)
    folders, to_do = [], []
    for row in rows:
        folder = out_dir / row.name
        parameters = run_parameters(plan, row, options, survey, duration_s)
        settings = _settings(plan, row, options, parameters)
        folders.append(folder)
        if _is_done(folder, settings):
            print(f"{plan.name} {row.name}: already there", flush=True)
        else:
            to_do.append((row, folder, settings))
    for row, folder, settings in to_do:
        _run(plan, row, options, bag, folder, settings)
    return folders


def _chosen(plan: Experiment, options: Options) -> list[Configuration]:
    """Those that are named; all of the engines' if none is."""
    known = {row.name: row for row in plan.configurations}
    for name in options.only:
        if name not in known:
            raise ExperimentError(f"configuration is '{name}', expected one of {', '.join(known)}")
    if options.only:
        return [row for name, row in known.items() if name in options.only]
    return [row for row in plan.configurations if row.engine in options.engines]


def _simulate(plan: Experiment, options: Options, out_dir: Path) -> Path:
    """The survey's bag, with what the simulator writes beside it."""
    bag = out_dir / "survey.bag"
    command = ["simulate_survey.py", "--mission", plan.mission]
    command += ["--scale", str(options.scale), "--seed", str(options.seed)]
    text = " ".join(command)
    note = out_dir / "survey.txt"  # written last, so that half a bag is made again
    if not note.is_file():
        if subprocess.run(["rosrun", PACKAGE, *command, "--out", str(bag)]).returncode:
            raise ExperimentError(f"simulating failed: {text}")
        note.write_text(text)
    elif note.read_text() != text:
        raise ExperimentError(
            f"{out_dir} holds the survey of '{note.read_text()}', expected that of '{text}': "
            "choose another --out"
        )
    return bag


def _duration_s(path: Path) -> float:
    with rosbag.Bag(str(path)) as bag:
        return bag.get_end_time() - bag.get_start_time()


def _settings(
    plan: Experiment, row: Configuration, options: Options, parameters: dict[str, Any]
) -> dict[str, Any]:
    """What a run is determined by."""
    return {
        "experiment": plan.name,
        "mission": plan.mission,
        "scale": options.scale,
        "seed": options.seed,
        "live_rate": options.rate if plan.live else None,
        "other_load": plan.other_load,
        "parameters": parameters,
    }


def _is_done(folder: Path, settings: dict[str, Any]) -> bool:
    file = folder / SETTINGS
    if not file.is_file() or not (folder / "report.json").is_file():
        return False
    ours, theirs = dict(flatten(json.loads(file.read_text())["settings"])), dict(flatten(settings))
    differing = sorted(n for n in ours.keys() | theirs.keys() if ours.get(n) != theirs.get(n))
    if differing:
        raise ExperimentError(
            f"{folder} holds a run with other settings ({', '.join(differing)}): choose another "
            "--out, or remove that folder"
        )
    return True


def _run(
    plan: Experiment,
    row: Configuration,
    options: Options,
    bag: Path,
    folder: Path,
    settings: dict[str, Any],
) -> None:
    """One launch, to its end."""
    print(f"{plan.name} {row.name}: running, output in {folder}/launch.log", flush=True)
    folder.mkdir(parents=True, exist_ok=True)
    for name in (SETTINGS, RESOURCES, "report.json"):
        (folder / name).unlink(missing_ok=True)
    config = folder / "config.yaml"
    config.write_text(yaml.safe_dump(settings["parameters"]))
    command = ["roslaunch", "--no-summary", PACKAGE]
    live = ["replay.launch", f"rate:={options.rate}"]
    command += live if plan.live else ["offline.launch"]
    command += [f"bag:={bag}", f"config:={config}", f"out:={folder}", "overwrite:=true"]
    command += [f"terrain:={bag.with_suffix('.terrain.npz')}"]
    # As they are now: the tree may change while a long run goes on.
    facts = {
        "settings": settings,
        "command": command,
        "commit": machine.commit(),
        "machine": machine.describe(),
    }
    with busy_core(plan.other_load), _launched(command, folder / "launch.log") as process:
        monitor = Monitor(process.pid, RESOURCE_PERIOD_S)
        status = _wait(process, folder / "launch.log")
        monitor.stop().save(folder / RESOURCES)
    if status or not (folder / "report.json").is_file():
        reason = _first_error(folder / "launch.log")
        raise ExperimentError(f"{row.name} ended without a report{reason}; see {folder}/launch.log")
    (folder / SETTINGS).write_text(json.dumps(facts, indent=2) + "\n")


@contextmanager
def _launched(command: list[str], log: Path) -> Iterator[subprocess.Popen]:
    """roslaunch; interrupted, not killed, if need be: it must take its nodes with it."""
    with log.open("w") as output:
        process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
            process.wait()


def _wait(process: subprocess.Popen, log: Path, period_s: float = PROGRESS_PERIOD_S) -> int:
    """Wait for its end, telling now and then how far it is; returns its exit status."""
    while True:
        try:
            return process.wait(period_s)
        except subprocess.TimeoutExpired:
            progress = _progress(log)
            if progress:
                print(f"  {progress}", flush=True)


def _progress(log: Path) -> str:
    """The newest line in which a replay says how far it is; empty before the first."""
    # Each is written over the one before, by a carriage return: one more end of a line to Python.
    lines = log.read_text(errors="replace").splitlines()
    return next((line.strip() for line in reversed(lines) if line.startswith(_PROGRESS)), "")


def _first_error(log: Path) -> str:
    """What a node says before it ends with a fault, or nothing."""
    for line in log.read_text(errors="replace").splitlines():
        if "[FATAL]" in line or "[ERROR]" in line or "error: " in line:
            return ": " + re.sub(r"\x1b\[[0-9;]*m", "", line).strip()
    return ""
