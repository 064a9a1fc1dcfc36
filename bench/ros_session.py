"""A ROS master and launch files for as long as a benchmark needs them."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import time
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
def running(command: list[str], log: Path) -> Iterator[subprocess.Popen]:
    """A process that is interrupted in the end; all that it prints goes to a file."""
    with log.open("w") as output:
        process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)
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


def wait_until(condition: Callable[[], bool], what: str, patience_s: float = PATIENCE_S) -> None:
    """Wait for something that must happen."""
    deadline_s = time.monotonic() + patience_s
    while not condition():
        if time.monotonic() > deadline_s:
            raise TimeoutError(f"waited {patience_s:g} s in vain for {what}")
        time.sleep(0.05)
