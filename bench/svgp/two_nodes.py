"""Training over ROS: steps per second of two map nodes that are fed by the running core."""

from __future__ import annotations

import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import rospy
import yaml

from bench.ros_session import cpu_s, master, running, simulated_survey, wait_until
from bench.svgp.contestants import available
from rbpf_svgp_slam.msg import FilterStatus, MapStatus

OPTIMIZERS = ("adam", "natgrad")
NODES, PARTICLES = 2, 4
S, M = 400, 1000
#: 256 beams at 4 Hz for so long: 150,000 beams.
MISSION, SURVEY_S = "lolo3", 150
SMALLEST_LOG = 120_000  # beams; refused ones and the last second may be missing
PLAY_RATE = 15
SETTLE_S, MEASURE_S = 3.0, 30.0


def run(out: Path) -> dict[str, Any]:
    """steps_per_s_two_nodes (Adam), the same for the other optimizers, and what is behind them."""
    with tempfile.TemporaryDirectory() as folder, master():
        bag = simulated_survey(MISSION, SURVEY_S, Path(folder))
        measured = {one.name: _measure(one.engine, bag, out) for one in available(OPTIMIZERS)}
    figures = {"steps_per_s_two_nodes": measured["adam"]["steps_per_s"]}
    for name in measured.keys() - {"adam"}:
        figures[f"steps_per_s_two_nodes_{name}"] = measured[name]["steps_per_s"]
    return figures | {"two_nodes": measured}


def _measure(optimizer: str, bag: Path, out: Path) -> dict[str, Any]:
    """Start core and nodes, fill the log, count the nodes' steps."""
    config = bag.with_name(f"{optimizer}.yaml")
    config.write_text(yaml.safe_dump(overlay(optimizer, PARTICLES)))
    survey = bag.with_suffix(".survey.yaml")
    launch = ["roslaunch", "--no-summary", "rbpf_svgp_slam", "slam.launch"]
    launch += [f"config:={config}", f"survey:={survey}"]
    with running(launch, out / f"two_nodes_{optimizer}.log"):
        status = Status()
        wait_until(status.complete, "core and map nodes")
        play = ["rosbag", "play", "--quiet", "--rate", str(PLAY_RATE), "--queue", "10000"]
        play += ["--wait-for-subscribers", str(bag), "--topics", "/odom", "/mbes/pings"]
        subprocess.run(play + ["/tf_static"], check=True, stdout=subprocess.DEVNULL)
        wait_until(lambda: status.core.beams >= SMALLEST_LOG, f"{SMALLEST_LOG} beams in the log")
        time.sleep(SETTLE_S)
        before = Snapshot(status)
        time.sleep(MEASURE_S)
        figures = training_figures(before, Snapshot(status))
        status.close()
    return figures


def overlay(optimizer: str, particles: int) -> dict[str, Any]:
    """Nothing but training: no loop closing, no pictures, every beam drawn from at once."""
    return {
        "particles": particles,
        "nodes": NODES,
        "mapping": {"hold_back_s": 0.0},
        "map": {"threads": 1, "publish_period_s": 0.0},
        "svgp": {"inducing_points": S, "minibatch_size": M, "optimizer": optimizer},
        "lc": {"rate_hz": 0.0},
        "evaluation": {"holdout": 0.0},
    }


class Status:
    """The latest status of the core and of each map node."""

    def __init__(self) -> None:
        self.core: FilterStatus | None = None
        self.nodes: dict[int, MapStatus] = {}
        self._subscribers = [rospy.Subscriber("rbpf_core/status", FilterStatus, self._take_core)]
        self._subscribers += [
            rospy.Subscriber(f"svgp_node_{k}/status", MapStatus, self._take_node)
            for k in range(NODES)
        ]

    def complete(self) -> bool:
        return self.core is not None and len(self.nodes) == NODES

    def close(self) -> None:
        for subscriber in self._subscribers:
            subscriber.unregister()

    def _take_core(self, message: FilterStatus) -> None:
        self.core = message

    def _take_node(self, message: MapStatus) -> None:
        self.nodes[message.node] = message


class Snapshot:
    """Counters at one moment."""

    def __init__(self, status: Status) -> None:
        self.time_s = time.monotonic()
        self.nodes = {f"svgp_node_{k}": message for k, message in status.nodes.items()}
        self.cpu_s = {name: cpu_s(name) for name in ("rbpf_core", *self.nodes)}
        self.beams = status.core.beams


def training_figures(before: Snapshot, now: Snapshot) -> dict[str, Any]:
    """Rates between two moments; steps per second by the status messages' own stamps."""
    rates = {}
    for name, first in before.nodes.items():
        last = now.nodes[name]
        seconds = (last.header.stamp - first.header.stamp).to_sec()
        rates[name] = (last.steps - first.steps) / seconds
    elapsed_s = now.time_s - before.time_s
    return {
        "steps_per_s": sum(rates.values()),
        "steps_per_s_by_node": rates,
        # of one core; where a node has less than 1, others were using the machine
        "cpu_share": {
            name: (now.cpu_s[name] - used_s) / elapsed_s for name, used_s in before.cpu_s.items()
        },
        "maps": sum(len(status.particles) for status in now.nodes.values()),
        "beams_in_log": now.beams,
        "skipped_steps": sum(status.skipped_steps for status in now.nodes.values()),
    }
