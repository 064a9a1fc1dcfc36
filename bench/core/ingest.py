"""How long pings wait to be taken in while map nodes ask for minibatches without a pause."""

from __future__ import annotations

import contextlib
import json
import signal
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
    with tempfile.TemporaryDirectory() as folder, master():
        overlay = Path(folder) / "ingest.yaml"
        overlay.write_text(yaml.safe_dump(_overlay()))
        launch = ["roslaunch", "--no-summary", "rbpf_svgp_slam", "slam.launch"]
        launch += [f"config:={overlay}", "local_nodes:=0"]
        with running(launch, out / "ingest.log"):
            return _measure()


def _overlay() -> dict[str, Any]:
    """Every beam can be drawn at once."""
    return {
        "particles": PARTICLES,
        "nodes": NODES,
        "survey_area": [[0.0, -60.0], [2000.0, -60.0], [2000.0, 60.0], [0.0, 60.0]],
        "mapping": {"hold_back_s": 0.0},
        "pings": {"max_range_m": 200.0},
    }


def _measure() -> dict[str, Any]:
    statuses: list[FilterStatus] = []
    rospy.Subscriber("rbpf_core/status", FilterStatus, statuses.append)
    vehicle = _Vehicle()
    wait_until(vehicle.is_heard, "the core")
    with _askers() as minibatches:
        sent = vehicle.sail()
        time.sleep(SETTLE_S)
        last = statuses[-1]
    asked = sum(minibatches)
    return {
        "ingest_p99_ms": 1e3 * last.ping_age_p99_s,
        "ingest_dropped": sent - last.pings,
        "ingest": {
            "largest_ms": 1e3 * last.ping_age_max_s,
            "pings": sent,
            "beams": last.beams,
            "duration_s": DURATION_S,
            "minibatches_per_s": asked / DURATION_S,
        },
    }


@contextlib.contextmanager
def _askers() -> Iterator[list[int]]:
    """Two stand-ins for map nodes; in the end the list holds the minibatches that each was sent."""
    share = PARTICLES // NODES
    processes = []
    for first in range(0, PARTICLES, share):
        command = [sys.executable, "-m", "bench.core.asker", str(first), str(first + share)]
        processes.append(subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True))
    minibatches: list[int] = []
    try:
        yield minibatches
    finally:
        for process in processes:
            process.send_signal(signal.SIGINT)
        for process in processes:
            minibatches.append(json.loads(process.communicate()[0])["minibatches"])


class _Vehicle:
    """Sails straight on over flat seabed; each ping comes with odometry of its own stamp."""

    def __init__(self) -> None:
        self._odometry = rospy.Publisher("odom", Odometry, queue_size=1000)
        self._pings = rospy.Publisher("mbes/pings", PointCloud2, queue_size=1000)

    def is_heard(self) -> bool:
        return min(p.get_num_connections() for p in (self._odometry, self._pings)) > 0

    def sail(self) -> int:
        """Publish at the rate that pings come at; returns their number."""
        pings = int(PING_RATE_HZ * DURATION_S)
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
