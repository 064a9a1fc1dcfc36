"""Starts the map nodes as child processes: roslaunch cannot count, and B is a parameter."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

from rbpf_svgp_slam.ros.map_node_start import load_parameters
from rbpf_svgp_slam.ros.parameters import ParameterError

POLL_S = 0.2
PATIENCE_S = 5.0  # for a node to end after SIGINT, before it is killed


def start_map_nodes() -> int | str:
    """Run svgp_node_0 .. B-1 until one ends or we are told to; returns what sys.exit() takes."""
    try:
        nodes = load_parameters().nodes
    except ParameterError as error:
        return f"svgp_nodes: {error}"
    # roslaunch stops a node by SIGINT, then SIGTERM: both must reach the children
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    children: list[subprocess.Popen] = []
    try:
        children = [subprocess.Popen(_command(index)) for index in range(nodes)]
        while all(child.poll() is None for child in children):
            time.sleep(POLL_S)
        index = next(k for k, child in enumerate(children) if child.poll() is not None)
        return f"svgp_nodes: svgp_node_{index} ended with exit status {children[index].poll()}"
    except KeyboardInterrupt:
        return 0
    finally:
        _stop(children)


def _command(index: int) -> list[str]:
    script = Path(sys.argv[0]).with_name("svgp_node.py")
    return [str(script), f"__name:=svgp_node_{index}", f"_index:={index}"]


def _stop(children: list[subprocess.Popen]) -> None:
    for child in children:
        if child.poll() is None:
            child.send_signal(signal.SIGINT)
    for child in children:
        try:
            child.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            child.kill()
