"""bench_filter_node and its map nodes: a filter of any size, whose prompts come when asked for."""

from __future__ import annotations

import contextlib
import json
import tempfile
import time
from pathlib import Path
from typing import Any, Iterator

import rospy
import yaml
from std_srvs.srv import Trigger

from bench.ros_session import rss_mb, running, wait_until
from rbpf_svgp_slam.msg import MapStatus
from rbpf_svgp_slam.nested import merged

S, M = 400, 1000
LAUNCH = Path(__file__).with_name("filter_node.launch")
START_PATIENCE_S = 120.0


class FilterSession:
    """See bench/core/filter_node.cpp for what the commands do."""

    def __init__(self, nodes: int) -> None:
        self.names = ["rbpf_core", *(f"svgp_node_{k}" for k in range(nodes))]
        self._statuses: dict[int, MapStatus] = {}
        for name in self.names[1:]:
            rospy.Subscriber(f"{name}/status", MapStatus, self._take)
        wait_until(lambda: len(self._statuses) == nodes, "the map nodes", START_PATIENCE_S)

    def grow(self, beams: int) -> dict[str, Any]:
        """Take in pings until the log holds so many beams."""
        rospy.set_param("rbpf_core/beams", beams)
        return self._command("grow")

    def prompt(self) -> dict[str, Any]:
        """One loop-closure prompt, of a whole ping."""
        return self._command("prompt")

    def resample(self) -> dict[str, Any]:
        """One resampling that replaces half of the particles."""
        return self._command("resample")

    def steps_per_map(self) -> float:
        """Training steps so far, of the node that has done fewest."""
        return min(status.steps / len(status.particles) for status in self._statuses.values())

    def wait_for_steps(self, steps: float, patience_s: float = START_PATIENCE_S) -> None:
        """Until every node has done so many more steps for each of its maps."""
        goal = self.steps_per_map() + steps
        wait_until(lambda: self.steps_per_map() >= goal, "the maps' training", patience_s)

    def steps_per_s(self, seconds: float) -> float:
        """Training steps of all nodes together, by the stamps of their own messages."""
        before = dict(self._statuses)
        time.sleep(seconds)
        return sum(
            (now.steps - first.steps) / (now.header.stamp - first.header.stamp).to_sec()
            for first, now in ((before[k], self._statuses[k]) for k in before)
        )

    def rss_mb(self) -> dict[str, float]:
        """Resident memory by node."""
        return {name: rss_mb(name) for name in self.names}

    def _take(self, status: MapStatus) -> None:
        self._statuses[status.node] = status

    @staticmethod
    def _command(name: str) -> dict[str, Any]:
        answer = rospy.ServiceProxy(f"rbpf_core/{name}", Trigger)()
        if not answer.success:
            raise RuntimeError(f"rbpf_core/{name} failed: {answer.message}")
        return json.loads(answer.message)


@contextlib.contextmanager
def filter_session(
    particles: int, nodes: int, maps: dict[str, Any], log: Path, ping_beams: int = 512
) -> Iterator[FilterSession]:
    """For as long as it is needed; a master must be running. maps: parameters of the engine."""
    with tempfile.NamedTemporaryFile("w", suffix=".yaml") as overlay:
        yaml.safe_dump(merged(_overlay(particles, nodes), maps), overlay)
        overlay.flush()
        command = ["roslaunch", "--no-summary", str(LAUNCH), f"config:={overlay.name}"]
        with running([*command, f"ping_beams:={ping_beams}"], log):
            yield FilterSession(nodes)


def svgp(optimizer: str) -> dict[str, Any]:
    """Of maps by the engine svgp."""
    return {"svgp": {"inducing_points": S, "minibatch_size": M, "optimizer": optimizer}}


def _overlay(particles: int, nodes: int) -> dict[str, Any]:
    """Every beam can be drawn at once, nothing is published, every prompt is weighed."""
    return {
        "particles": particles,
        "nodes": nodes,
        "survey_area": [[-100.0, -100.0], [100.0, -100.0], [100.0, 100.0], [-100.0, 100.0]],
        "motion": {"surge_std_m": 0.005, "sway_std_m": 0.005, "yaw_std_rad": 0.0001},
        "mapping": {"hold_back_s": 0.0},
        "map": {"threads": 1, "publish_period_s": 0.0},
        "lc": {"min_overlap": 0.001, "mapped_variance": 2.0, "veto_sigma": 1e6},
        "evaluation": {"holdout": 0.0},
    }
