"""The offline replay with mapping off: a full survey of the paper's first experiment."""

from __future__ import annotations

import math
import tempfile
import time
from pathlib import Path
from typing import Any

import rosbag
import rospy
import yaml

from bench.paths import BINARIES
from bench.ros_session import master, peak_rss_mb, running, simulated_survey, wait_until
from rbpf_svgp_slam.msg import FilterStatus

MISSION = "hugin1"  # 8 million beams
PARTICLES = 100
PATIENCE_S = 300.0


def run(out: Path) -> dict[str, Any]:
    """offline_real_time_factor_hugin1, by the replay's own clock, and the size of the survey."""
    with tempfile.TemporaryDirectory() as folder, master():
        start_s = time.monotonic()
        bag = simulated_survey(MISSION, math.inf, Path(folder))
        simulation_s = time.monotonic() - start_s
        _set_parameters(bag)
        statuses: list[FilterStatus] = []
        rospy.Subscriber("rbpf_core/status", FilterStatus, statuses.append)
        # rosrun finds no binary in a build folder that lies within the package
        command = [str(BINARIES / "rbpf_offline"), f"_bag:={bag}", "_take_turns:=true"]
        with running(command, out / "offline.log"):
            finished = "rbpf_core/replay_finished"
            wait_until(lambda: rospy.get_param(finished, False), "the replay's end", PATIENCE_S)
            wall_s = rospy.get_param("rbpf_core/replay_wall_s")
            after = len(statuses) + 2  # the next one may have been on its way
            wait_until(lambda: len(statuses) >= after, "the final status")
            core_mb = peak_rss_mb("rbpf_core")
        last = statuses[-1]
        with rosbag.Bag(str(bag)) as recorded:
            survey_s = recorded.get_end_time() - recorded.get_start_time()
        return {
            "offline_real_time_factor_hugin1": survey_s / wall_s,
            "offline": {
                "wall_s": wall_s,
                "survey_s": survey_s,
                "particles": PARTICLES,
                "odometry_messages": last.odometry_messages,
                "pings": last.pings,
                "pings_dropped": last.pings_dropped,
                "beams": last.beams + last.beams_held_out,
                "bag_mb": bag.stat().st_size / 1e6,
                "core_peak_rss_mb": core_mb,
                "simulation_s": simulation_s,
            },
        }


def _set_parameters(bag: Path) -> None:
    """What offline.launch would load."""
    defaults = Path(__file__).parents[2] / "config" / "default.yaml"
    for file in (defaults, bag.with_suffix(".survey.yaml")):
        for name, value in _leaves(yaml.safe_load(file.read_text())):
            rospy.set_param(f"rbpf_svgp_slam/{name}", value)
    rospy.set_param("rbpf_svgp_slam/particles", PARTICLES)
    rospy.set_param("rbpf_svgp_slam/offline/steps_per_second", 0.0)


def _leaves(tree: dict[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    """Names and values: an overlay must not take away what it does not name."""
    leaves = []
    for name, value in tree.items():
        if isinstance(value, dict):
            leaves += _leaves(value, f"{prefix}{name}/")
        else:
            leaves.append((prefix + name, value))
    return leaves
