"""Prompts and resamplings at J = 100 with pings of 512 beams, while two map nodes train."""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import rospy
import yaml

from bench.ros_session import master, running, simulated_survey, wait_until
from rbpf_svgp_slam.msg import FilterStatus

OPTIMIZERS = ("streaming", "adam", "natgrad")
PARTICLES, NODES = 100, 2
MISSION, SURVEY_S = "hugin1", 30  # 512 beams at 3 Hz
#: Slow enough for a machine that does something else besides.
PLAY_RATE = 0.5


def run(out: Path) -> dict[str, Any]:
    """Median times of the default optimizer; median, largest and traffic of each."""
    with tempfile.TemporaryDirectory() as folder, master():
        bag = simulated_survey(MISSION, SURVEY_S, Path(folder))
        measured = {}
        for name in OPTIMIZERS:
            measured[name] = _measure(name, bag, out)
            print(name, measured[name], flush=True)
    default = measured[OPTIMIZERS[0]]
    return {
        "prompt_s_j100": default["prompt_s"]["median"],
        "resampling_s_j100": default["resampling_s"]["median"],
        "loop_closures": measured,
    }


def _overlay(optimizer: str) -> dict[str, Any]:
    """Every prompt is weighted, and leaves so few effective particles that half are replaced."""
    return {
        "particles": PARTICLES,
        "nodes": NODES,
        "mapping": {"hold_back_s": 0.0},
        "map": {"threads": 1, "publish_period_s": 0.0},
        "svgp": {
            "optimizer": optimizer,
            "convergence": {"decay": 0.5, "window": 1, "tolerance": 1e6},
        },
        "lc": {
            "rate_hz": 1.0,
            "effective_beams": 1e4,
            "min_overlap": 0.001,
            "mapped_variance": 2.0,
            "veto_sigma": 1e6,
            "min_n_eff_share": 0.35,
        },
        "evaluation": {"holdout": 0.0},
        "output": {"publish_rate_hz": 10.0},
    }


def _measure(optimizer: str, bag: Path, out: Path) -> dict[str, Any]:
    overlay = bag.with_name(f"{optimizer}.yaml")
    overlay.write_text(yaml.safe_dump(_overlay(optimizer)))
    survey = bag.with_suffix(".survey.yaml")
    launch = ["roslaunch", "--no-summary", "rbpf_svgp_slam", "slam.launch"]
    launch += [f"config:={overlay}", f"survey:={survey}"]
    statuses: list[FilterStatus] = []
    with running(launch, out / f"loop_closures_{optimizer}.log"):
        subscriber = rospy.Subscriber("rbpf_core/status", FilterStatus, statuses.append)
        wait_until(lambda: bool(statuses), "the core")
        play = [
            "rosbag",
            "play",
            "--quiet",
            "--rate",
            str(PLAY_RATE),
            "--queue",
            "10000",
            "--wait-for-subscribers",
        ]
        play += [str(bag), "--topics", "/odom", "/mbes/pings", "/tf_static"]
        subprocess.run(play, check=True, stdout=subprocess.DEVNULL)
        subscriber.unregister()
    return _figures(statuses)


def _figures(statuses: list[FilterStatus]) -> dict[str, Any]:
    prompts = {s.prompts: s.prompt_s for s in statuses if s.prompts > 0}
    resamplings = {s.epoch: s.resampling_s for s in statuses if s.epoch > 0}
    last = statuses[-1]
    return {
        "prompt_s": _spread(prompts.values()),
        "resampling_s": _spread(resamplings.values()),
        "resamplings_failed": last.resamplings_failed,
        "maps_moved_per_resampling": last.maps_moved / max(1, last.epoch),
        "bytes_per_map": last.bytes_moved / max(1, last.maps_moved),
        "pings_dropped": last.pings_dropped,
        "steps": last.iterations,
    }


def _spread(times_s: Any) -> dict[str, float]:
    times_s = np.array(list(times_s))
    return {
        "median": float(np.median(times_s)),
        "largest": float(times_s.max()),
        "count": len(times_s),
    }
