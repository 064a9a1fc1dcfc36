"""How long pings wait to be taken in while map nodes ask for minibatches without a pause."""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Iterator

import numpy as np
import rospy
import yaml
from nav_msgs.msg import Odometry
from sensor_msgs.msg import PointCloud2, PointField

from bench.paths import ROOT
from bench.ros_session import master, running, wait_until
from rbpf_svgp_slam.msg import FilterStatus

PARTICLES, NODES = 100, 2
PING_RATE_HZ, BEAMS = 20, 512
DURATION_S = 600.0
SPEED_MPS = 2.0
SETTLE_S = 3.0


def run(out: Path) -> dict[str, Any]:
    """ingest_p99_ms and ingest_dropped, by the core's own account, and what it did besides."""
    minibatches: list[int] = []
    with core(out / "ingest.log", local_nodes=0) as statuses, _askers(minibatches):
        figures = sail(statuses, DURATION_S)
    figures["minibatches_per_s"] = sum(minibatches) / (DURATION_S + SETTLE_S)
    return {
        "ingest_p99_ms": figures["p99_ms"],
        "ingest_dropped": figures["dropped"],
        "ingest": figures,
    }


@contextlib.contextmanager
def core(log: Path, local_nodes: int, **overlay: Any) -> Iterator[list[FilterStatus]]:
    """The live core, from whose log every beam can be drawn at once; its statuses."""
    settings = {
        "particles": PARTICLES,
        "nodes": NODES,
        "survey_area": [[0.0, -60.0], [2000.0, -60.0], [2000.0, 60.0], [0.0, 60.0]],
        "mapping": {"hold_back_s": 0.0},
        "pings": {"max_range_m": 200.0},
    }
    with tempfile.NamedTemporaryFile("w", suffix=".yaml") as config, master():
        yaml.safe_dump(settings | overlay, config)
        config.flush()
        launch = ["roslaunch", "--no-summary", "rbpf_svgp_slam", "slam.launch"]
        launch += [f"config:={config.name}", f"local_nodes:={local_nodes}"]
        with running(launch, log):
            statuses: list[FilterStatus] = []
            rospy.Subscriber("rbpf_core/status", FilterStatus, statuses.append)
            wait_until(lambda: bool(statuses), "the core")
            yield statuses


def sail(statuses: list[FilterStatus], duration_s: float) -> dict[str, Any]:
    """What has become of pings that were sent for so long."""
    vehicle = _Vehicle()
    wait_until(vehicle.is_heard, "the core's ears")
    sent = vehicle.sail(duration_s)
    time.sleep(SETTLE_S)
    last = statuses[-1]
    return {
        "p99_ms": 1e3 * last.ping_age_p99_s,
        "largest_ms": 1e3 * last.ping_age_max_s,
        "dropped": sent - last.pings,
        "pings": sent,
        "beams": last.beams,
        "duration_s": duration_s,
    }


@contextlib.contextmanager
def _askers(minibatches: list[int]) -> Iterator[None]:
    """Stand-ins for map nodes; in the end the list holds the minibatches that each was sent."""
    share = PARTICLES // NODES
    processes = []
    for first in range(0, PARTICLES, share):
        command = [sys.executable, "-m", "bench.core.asker", str(first), str(first + share)]
        processes.append(subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True))
    try:
        yield
    finally:
        for process in processes:
            process.terminate()
        for process in processes:
            minibatches.append(json.loads(process.communicate()[0])["minibatches"])


class _Vehicle:
    """Sails straight on over flat seabed; each ping comes with odometry of its own stamp."""

    def __init__(self) -> None:
        self._odometry = rospy.Publisher("odom", Odometry, queue_size=1000)
        self._pings = rospy.Publisher("mbes/pings", PointCloud2, queue_size=1000)

    def is_heard(self) -> bool:
        return min(p.get_num_connections() for p in (self._odometry, self._pings)) > 0

    def sail(self, duration_s: float) -> int:
        """Publish at the rate that pings come at; returns their number."""
        pings = int(PING_RATE_HZ * duration_s)
        start_s = time.monotonic()
        for k in range(pings):
            time.sleep(max(0.0, start_s + k / PING_RATE_HZ - time.monotonic()))
            stamp = rospy.Time.now()
            self._odometry.publish(_odometry(stamp, SPEED_MPS * k / PING_RATE_HZ))
            self._pings.publish(_ping(stamp))
        return pings


def _odometry(stamp: rospy.Time, x_m: float) -> Odometry:
    message = Odometry(child_frame_id="base_link")
    message.header.stamp, message.header.frame_id = stamp, "odom"
    message.pose.pose.position.x, message.pose.pose.position.z = x_m, -10.0
    message.pose.pose.orientation.w = 1.0
    message.twist.twist.linear.x = SPEED_MPS
    return message


def _ping(stamp: rospy.Time) -> PointCloud2:
    """Beams across the track over 120 degrees, 20 m below."""
    beams = np.zeros((BEAMS, 3), dtype="<f4")
    beams[:, 1] = 20.0 * np.tan(np.radians(np.linspace(-60.0, 60.0, BEAMS)))
    beams[:, 2] = -20.0
    message = PointCloud2(height=1, width=BEAMS, point_step=12, row_step=12 * BEAMS)
    message.header.stamp, message.header.frame_id = stamp, "base_link"
    message.fields = [
        PointField(axis, 4 * i, PointField.FLOAT32, 1) for i, axis in enumerate("xyz")
    ]
    message.data, message.is_dense = beams.tobytes(), True
    return message
