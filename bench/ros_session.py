"""A ROS master and launch files for as long as a benchmark needs them."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import time
import xmlrpc.client
from pathlib import Path
from typing import Callable, Iterator

import rosgraph
import rospy

PATIENCE_S = 60.0
STOP_PATIENCE_S = 20.0


@contextlib.contextmanager
def master() -> Iterator[None]:
    """A master at ROS_MASTER_URI(tools/env.sh sets it), with this process as a node."""
    port = rosgraph.get_master_uri().rsplit(":", 1)[1].strip("/")
    with running(["roscore", "-p", port], Path(os.devnull)):
        wait_until(rosgraph.is_master_online, "the ROS master")
        rospy.init_node("bench", disable_signals=True)
        yield
        rospy.signal_shutdown("done")


@contextlib.contextmanager
def running(
    command: list[str], log: Path, environment: dict[str, str] | None = None
) -> Iterator[subprocess.Popen]:
    """A process that is interrupted in the end; all that it prints goes to a file.

    environment: the process's own, in place of ours.
    """
    with log.open("w") as output:
        process = subprocess.Popen(
            command, stdout=output, stderr=subprocess.STDOUT, env=environment
        )
    try:
        yield process
    finally:
        # roslaunch takes its nodes with it, unless it is killed
        process.send_signal(signal.SIGINT)
        try:
            process.wait(STOP_PATIENCE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def simulated_survey(mission: str, duration_s: float, folder: Path) -> Path:
    """A bag in the folder, with survey.survey.yaml beside it."""
    bag = folder / "survey.bag"
    command = ["rosrun", "rbpf_svgp_slam", "simulate_survey.py", "--mission", mission]
    command += ["--duration", str(duration_s), "--out", str(bag)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return bag


def wait_until(condition: Callable[[], bool], what: str, patience_s: float = PATIENCE_S) -> None:
    """Wait for something that must happen."""
    deadline_s = time.monotonic() + patience_s
    while not condition():
        if time.monotonic() > deadline_s:
            raise TimeoutError(f"waited {patience_s:g} s in vain for {what}")
        time.sleep(0.05)


def cpu_s(node: str) -> float:
    """Processor time, s, that a running ROS node of this machine has used so far."""
    # fields 14 and 15 of proc(5): utime and stime; the second, the name, may hold blanks
    fields = _process(node).joinpath("stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def rss_mb(node: str) -> float:
    """Resident memory, MB (1e6 bytes), of a running ROS node of this machine."""
    pages = int(_process(node).joinpath("statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGESIZE") / 1e6


def _process(node: str) -> Path:
    """Its folder in /proc."""
    uri = rosgraph.Master("/bench").lookupNode(f"/{node}")
    _, _, pid = xmlrpc.client.ServerProxy(uri).getPid("/bench")
    return Path(f"/proc/{pid}")
