"""Training on another host than the core's, next to none and 20 ms of delay between them."""

from __future__ import annotations

import contextlib
import subprocess
import tempfile
import time
from pathlib import Path
from statistics import mean
from typing import Any, Iterator

import yaml

from bench.network.hosts import Host, Link, bytes_over_link, impediment, two_hosts
from bench.ros_session import master, running, simulated_survey, wait_until
from bench.svgp.two_nodes import Snapshot, Status, overlay, training_figures

#: Optimizer and particles: the paper's and the default one; few maps per node, and more.
CASES = (("adam", 4), ("adam", 20), ("streaming", 4), ("streaming", 20))
DELAY_S = 0.02  # each way: a round trip takes 40 ms
#: 256 beams at 4 Hz. The first part fills the log, the second comes in while steps are counted.
MISSION, SURVEY_S, FILL_S = "lolo3", 100, 60
FILL_RATE = 15
SMALLEST_LOG = 0.9 * FILL_S * 4 * 256  # beams
#: Not from the start, where streaming maps have little to rebuild yet, and in an order in which a
#: trend favours neither.
WARM_UP_S, SETTLE_S, MEASURE_S = 5.0, 1.5, 4.5
ORDER = (0.0, DELAY_S, DELAY_S, 0.0)


def run(out: Path) -> dict[str, Any]:
    """Steps per second of two map nodes, without and with delay, by optimizer and particles."""
    if impediment():
        print(f"left out: {impediment()}", flush=True)
        return {}
    measured = {}
    with two_hosts(0.0) as (first, second, link), tempfile.TemporaryDirectory() as folder:
        bag = simulated_survey(MISSION, SURVEY_S, Path(folder))
        first.enter()
        with master():
            for optimizer, particles in CASES:
                name = f"{optimizer}_{particles}"
                with _session(
                    optimizer, particles, bag, second, out / f"two_hosts_{name}"
                ) as status:
                    measured[name] = _measure(status, link, bag)
    return {"two_hosts": measured}


@contextlib.contextmanager
def _session(
    optimizer: str, particles: int, bag: Path, nodes_host: Host, log: Path
) -> Iterator[Status]:
    """The core here and both map nodes there, with beams in the log."""
    config = bag.with_name("config.yaml")
    config.write_text(yaml.safe_dump(overlay(optimizer, particles)))
    launch = ["roslaunch", "--no-summary", "rbpf_svgp_slam"]
    core = [*launch, "slam.launch", f"config:={config}", "local_nodes:=0"]
    core += [f"survey:={bag.with_suffix('.survey.yaml')}"]
    nodes = nodes_host.command(*launch, "svgp_nodes.launch")
    with running(core, log.with_suffix(".core.log")), running(
        nodes, log.with_suffix(".nodes.log"), nodes_host.environment()
    ):
        status = Status()
        wait_until(status.complete, "core and map nodes")
        with _playing(bag, "--rate", str(FILL_RATE), "--duration", str(FILL_S)) as player:
            player.wait()
        wait_until(lambda: status.core.beams >= SMALLEST_LOG, f"{SMALLEST_LOG:g} beams in the log")
        yield status
        status.close()


@contextlib.contextmanager
def _playing(bag: Path, *options: str) -> Iterator[subprocess.Popen]:
    play = ["rosbag", "play", "--quiet", "--queue", "10000", "--wait-for-subscribers", *options]
    play += ["--bags", str(bag), "--topics", "/odom", "/mbes/pings", "/tf_static"]
    with running(play, Path("/dev/null")) as process:
        yield process


def _measure(status: Status, link: Link, bag: Path) -> dict[str, Any]:
    """Steps, and bytes that cross the link, per second."""
    rates: dict[float, list[dict[str, Any]]] = {0.0: [], DELAY_S: []}
    with _playing(bag, "--start", str(FILL_S)):
        time.sleep(WARM_UP_S)
        for delay_s in ORDER:
            link.set_delay(delay_s)
            time.sleep(SETTLE_S)
            before, bytes_before = Snapshot(status), bytes_over_link()
            time.sleep(MEASURE_S)
            figures = training_figures(before, Snapshot(status))
            figures["bytes_per_s"] = (bytes_over_link() - bytes_before) / MEASURE_S
            rates[delay_s].append(figures)
    link.set_delay(0.0)
    figures = {}
    for delay_s, name in ((0.0, "no_delay"), (DELAY_S, "20ms_delay")):
        for quantity in ("steps_per_s", "bytes_per_s"):
            figures[f"{quantity}_{name}"] = mean(one[quantity] for one in rates[delay_s])
    figures["ratio"] = figures["steps_per_s_20ms_delay"] / figures["steps_per_s_no_delay"]
    figures["runs"] = [*rates[0.0], *rates[DELAY_S]]
    figures["skipped_steps"] = max(one["skipped_steps"] for one in figures["runs"])
    return figures
