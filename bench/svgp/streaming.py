"""Streaming maps at J = 100 while the survey goes on: how far is each from its own optimum?"""

from __future__ import annotations

import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import rospy
import torch
import yaml

from bench.ros_session import cpu_s, master, running, simulated_survey, wait_until
from bench.svgp.two_nodes import NODES, Status
from rbpf_svgp_slam.map_node.core_client import BeamReader
from rbpf_svgp_slam.maps import load_map
from rbpf_svgp_slam.recorder.survey_client import fetch_map, fetch_survey
from rbpf_svgp_slam.run.survey_run import place_beams
from rbpf_svgp_slam.survey_area.polygon import survey_origin
from rbpf_svgp_slam.svgp.streaming_svgp import StreamingSvgp

PARTICLES = 100
MISSION, SURVEY_S = "lolo3", 300
HOLD_BACK_S = 30.0
#: Held-out pings this close to the newest beams that maps can have are left out: a map is behind by
#: up to a second, and where it is, errors depend on how far.
MARGIN_S = 3.0
#: The first map is looked at after so many seconds of survey, and the next ones in this interval.
FIRST_S, PERIOD_S = 60.0, 12.0
BLOCK_BEAMS = 100_000


@dataclass
class Probe:
    """One particle's map at one moment."""

    beams_in_log: int
    behind: int  # beams not taken in yet
    rmse_m: float  # of held-out beams
    optimum_rmse_m: float  # of the optimum for its model and all its beams


def run(out: Path) -> dict[str, Any]:
    """The worst and the mean ratio of a map's held-out RMSE to its optimum's, and the load."""
    with tempfile.TemporaryDirectory() as folder, master():
        bag = simulated_survey(MISSION, SURVEY_S, Path(folder))
        overlay = bag.with_name("streaming.yaml")
        overlay.write_text(yaml.safe_dump(_overlay()))
        survey = bag.with_suffix(".survey.yaml")
        area = yaml.safe_load(survey.read_text())["survey_area"]
        launch = ["roslaunch", "--no-summary", "rbpf_svgp_slam", "slam.launch"]
        launch += [f"config:={overlay}", f"survey:={survey}"]
        with running(launch, out / "streaming.log"):
            return _watch(bag, survey_origin(area))


def _overlay() -> dict[str, Any]:
    return {
        "particles": PARTICLES,
        "nodes": NODES,
        "mapping": {"hold_back_s": HOLD_BACK_S},
        "map": {"threads": 1, "publish_period_s": 0.0},
        "svgp": {"optimizer": "streaming"},
        "evaluation": {"holdout": 0.05},
    }


def _watch(bag: Path, origin_m: np.ndarray) -> dict[str, Any]:
    """Play the survey at the rate it was made at, and look at one map after the other."""
    status = Status()
    wait_until(status.complete, "core and map nodes")
    play = ["rosbag", "play", "--quiet", "--queue", "10000", "--wait-for-subscribers", str(bag)]
    play += ["--topics", "/odom", "/mbes/pings", "/tf_static"]
    names = ("rbpf_core", "svgp_node_0", "svgp_node_1")
    probes: list[Probe] = []
    with subprocess.Popen(play, stdout=subprocess.DEVNULL) as player:
        start_s, used_s = time.monotonic(), {name: cpu_s(name) for name in names}
        time.sleep(FIRST_S)
        while player.poll() is None:
            due_s = time.monotonic() + PERIOD_S
            # from one end to the other of both nodes' shares
            particle = 37 * len(probes) % PARTICLES
            probe = _probe(particle, status, origin_m)
            probes += [probe] if probe else []
            time.sleep(max(0.0, due_s - time.monotonic()))
        elapsed_s = time.monotonic() - start_s
    shares = {name: (cpu_s(name) - used_s[name]) / elapsed_s for name in names}
    return {"streaming": _figures(probes, status, shares)}


def _figures(probes: list[Probe], status: Status, shares: dict[str, float]) -> dict[str, Any]:
    ratios = [probe.rmse_m / probe.optimum_rmse_m for probe in probes]
    return {
        "rmse_vs_optimum_worst": max(ratios),
        "rmse_vs_optimum_mean": float(np.mean(ratios)),
        "probes": len(probes),
        "maps": PARTICLES,
        "beams_behind_worst": max(probe.behind for probe in probes),
        "beams_in_log": probes[-1].beams_in_log,
        "behind_by_probe": [probe.behind for probe in probes],
        "rmse_m_by_probe": [round(probe.rmse_m, 4) for probe in probes],
        "ratio_by_probe": [round(ratio, 4) for ratio in ratios],
        "resamplings": status.core.epoch,
        "pings_dropped": status.core.pings_dropped,
        "iterations": status.core.iterations,
        "cpu_share": shares,
    }


def _probe(particle: int, status: Status, origin_m: np.ndarray) -> Probe | None:
    """None if a resampling came in between."""
    epoch = status.core.epoch
    try:
        engine = load_map("svgp", fetch_map(particle, epoch, PARTICLES, NODES))
        beams, reply_epoch = _all_beams(particle)
        survey = fetch_survey()
    except (RuntimeError, rospy.ServiceException):
        return None
    if reply_epoch != epoch:
        return None
    mapped = survey.stamp_s < survey.stamp_s[-1] - HOLD_BACK_S - MARGIN_S
    chosen = (survey.held_out & mapped)[survey.ping_of_beam]
    placed = place_beams(survey.levelled, survey.ping_of_beam, survey.estimate)
    points = placed[chosen] - [*origin_m, 0.0]
    return Probe(
        beams_in_log=len(beams),
        behind=len(beams) - engine.next_beam,
        rmse_m=_rmse(engine, points),
        optimum_rmse_m=_rmse(optimum(engine, beams), points),
    )


def optimum(engine: StreamingSvgp, beams: np.ndarray) -> StreamingSvgp:
    """The map with the same model whose q(v) is the best for all of the beams [N, 3]."""
    twin = StreamingSvgp.from_bytes(engine.to_bytes())
    optimizer = twin.optimizer
    X = torch.from_numpy(beams[:, :2].copy())
    y = torch.from_numpy((beams[:, 2].astype(float) - optimizer.reference_m).astype(np.float32))
    optimizer.rebuild(optimizer.fixed, X, y, len(beams))
    return twin


def _all_beams(particle: int) -> tuple[np.ndarray, int]:
    """All beams [N, 3] in the log, placed by the particle's history, and the epoch."""
    core, parts, epochs = BeamReader(), [], set()
    while True:
        reply = core.read([particle], sum(map(len, parts)), BLOCK_BEAMS)
        if reply is None:
            raise RuntimeError("no beams from the core")
        parts.append(reply.beams.placed(0))
        epochs.add(reply.epoch)
        if len(reply.beams) < BLOCK_BEAMS:
            return np.concatenate(parts), epochs.pop() if len(epochs) == 1 else -1


def _rmse(engine: StreamingSvgp, points: np.ndarray) -> float:
    return float(np.sqrt(np.mean((engine.predict(points[:, :2])[0] - points[:, 2]) ** 2)))
