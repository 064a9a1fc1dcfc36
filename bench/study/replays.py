"""One contestant on one survey: an offline replay by the package's own launch file, and its row."""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from bench.paths import ROOT
from bench.study.cases import BASE_SCALE, Case
from bench.study.contestants import overlay
from rbpf_svgp_slam import machine
from rbpf_svgp_slam.bags.survey_bag import write_bag
from rbpf_svgp_slam.simulation.simulate_command import write_overlay
from rbpf_svgp_slam.simulation.terrain import save_terrain

#: Of a row, as report.json names them.
FIELDS = (
    "dr_ate_rmse_m dr_ate_aligned_rmse_m online_ate_rmse_m ate_rmse_m ate_aligned_rmse_m "
    "ideal_online_ate_rmse_m ideal_ate_rmse_m ideal_ate_aligned_rmse_m online_nees nees "
    "closures_accepted closures_refused closures_wrong loop_closure_prompts resamplings "
    "founders smoothing_s map_rmse_m seabed_rmse_m grid_rmse_m duration_s wall_s"
).split()
PATIENCE_S = 3600.0


class RunFailed(Exception):
    """A run that ended badly, or not in time."""


def make_survey(case: Case, seed: int, folder: Path, scale: float = BASE_SCALE) -> Path:
    """Write the survey's bag with overlay and seabed beside it, unless it is there."""
    bag = folder / f"{case.name}_{seed}.bag"
    if not bag.is_file():
        survey = case.survey(seed, scale)
        save_terrain(bag.with_suffix(".terrain.npz"), survey.terrain)
        write_overlay(bag.with_suffix(".survey.yaml"), survey)
        half = bag.with_suffix(".half")
        write_bag(str(half), survey.recorded(), lambda share: None)
        half.rename(bag)
    return bag


def replay(contestant: str, seed: int, bag: Path, folder: Path) -> dict[str, Any]:
    """Run it; returns the row's figures. The run folder keeps its report and its tracks."""
    folder.mkdir(parents=True, exist_ok=True)
    config = folder / "config.yaml"
    config.write_text(yaml.safe_dump({**overlay(contestant), "seed": seed}), encoding="utf-8")
    command = ["rosrun", "rbpf_svgp_slam", "run_launch.py", "offline.launch", "check:=false"]
    command += [f"bag:={bag}", f"survey:={bag.with_suffix('.survey.yaml')}"]
    command += [f"terrain:={bag.with_suffix('.terrain.npz')}", f"config:={config}"]
    command += [f"out:={folder}"]
    return _row(command, folder, env=_own_master())


def run_peer(name: str, case: Case, seed: int, folder: Path) -> dict[str, Any]:
    """Have a peer (bench/peers) run on the survey, without ROS; returns the same figures."""
    folder.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", "bench.peers", name, case.name, str(seed), str(folder)]
    return _row(command, folder, cwd=ROOT)


def _row(command: list[str], folder: Path, **how: Any) -> dict[str, Any]:
    """What the command writes into report.json; how: as subprocess.run has it."""
    started_s = time.monotonic()
    try:
        with (folder / "launch.log").open("w") as log:
            how.update(stdout=log, stderr=subprocess.STDOUT, timeout=PATIENCE_S)
            subprocess.run(command, check=True, **how)
    except subprocess.SubprocessError as error:
        raise RunFailed(f"{error} See {folder}/launch.log") from error
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    _drop_large_files(folder)
    row = {name: report.get(name) for name in FIELDS}
    row["closures_refused"] = sum((row["closures_refused"] or {}).values())
    row["launch_s"] = round(time.monotonic() - started_s, 1)
    row["commit"] = machine.commit()
    return row


def _own_master() -> dict[str, str]:
    """The environment, with a ROS master on a port that is free now."""
    with socket.socket() as probe:
        probe.bind(("", 0))
        port = probe.getsockname()[1]
    return {**os.environ, "ROS_MASTER_URI": f"http://localhost:{port}"}


def _drop_large_files(folder: Path) -> None:
    for path in folder.iterdir():
        if path.is_dir():
            shutil.rmtree(path)
        elif path.suffix in (".npz", ".html", ".gif"):
            path.unlink()


def rows_in(file: Path) -> dict[tuple[str, int, str], dict[str, Any]]:
    """The rows of a study's file by their keys; none where it is not there."""
    lines = file.read_text(encoding="utf-8").splitlines() if file.is_file() else []
    return {key_of(row): row for row in map(json.loads, lines)}


def key_of(row: dict[str, Any]) -> tuple[str, int, str]:
    """Case, seed and contestant: of these a study has one run."""
    return row["case"], row["seed"], row["contestant"]


def ratio(row: dict[str, Any], name: str, other: str) -> float:
    """Of two fields; NaN where either is missing."""
    if row[name] is None or not row[other]:
        return float(np.nan)
    return row[name] / row[other]
