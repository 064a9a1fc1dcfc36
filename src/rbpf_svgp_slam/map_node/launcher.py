"""Starts the map nodes as child processes: roslaunch cannot count, and B is a parameter."""

from __future__ import annotations

import argparse
import itertools
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Collection, Sequence

import rosgraph

from rbpf_svgp_slam.parameters.rules import ParameterError
from rbpf_svgp_slam.parameters.server import load_parameters
from rbpf_svgp_slam.processes import Deaths, end_with_parent
from rbpf_svgp_slam.protocol import names
from rbpf_svgp_slam.protocol.running_nodes import listens, uri_of

POLL_S = 0.5
# For all nodes together to end after SIGINT, before they are killed: roslaunch gives us 15 s after
# its own, and only 2 s more after SIGTERM.
PATIENCE_S = 5.0
NOTICE_S = 3.0  # of waiting for the core, after which we say so
# For the master; a host that has been switched off never answers.
ANSWER_S = 5.0
ALL = "all"


def start_map_nodes(arguments: Sequence[str]) -> int | str:
    """Run this host's map nodes until one ends or we are told to; returns what sys.exit() takes.

    One that a signal has ended is started again, and learns its maps from the core's log; but not
    in an offline replay, which is to be the same every time.
    """
    options = _parse(arguments)
    # roslaunch stops a node by SIGINT, then SIGTERM: both must reach the children, SIGINT also
    # where a script in the background has had it ignored
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)
    socket.setdefaulttimeout(ANSWER_S)
    children: dict[int, subprocess.Popen] = {}
    try:
        _wait_for_core()
        nodes = load_parameters("svgp_nodes").nodes
        indices = share_of_host(options.first, options.count, nodes)
        _check_not_running(indices)
        children.update((index, _start(index)) for index in indices)
        return f"svgp_nodes: {_watch(children, start_again=not _is_offline())}"
    except ParameterError as error:
        return f"svgp_nodes: {error}"
    except KeyboardInterrupt:
        return 0
    finally:
        _stop(children.values())


def _start(index: int, restarts: int = 0) -> subprocess.Popen:
    # In a session of its own: roslaunch interrupts our whole process group, and a node that is
    # interrupted a second time, by us, may be in the midst of logging the first.
    return subprocess.Popen(
        _command(index, restarts), start_new_session=True, preexec_fn=end_with_parent
    )


def share_of_host(first: str, count: str, nodes: int) -> range:
    """Indices of the map nodes that a host starts, of 0 .. nodes - 1."""
    of_all = f"{names.PARAMETERS}/nodes is {nodes}"
    if not (first.isdecimal() and int(first) < nodes):
        raise ParameterError(f"first is {first}; expected an integer in 0 .. {nodes - 1}: {of_all}")
    most = nodes - int(first)
    if count == ALL:
        count = str(most)
    if not (count.isdecimal() and 1 <= int(count) <= most):
        raise ParameterError(
            f"count is {count}; expected {ALL} or an integer in 1 .. {most}: {of_all}, "
            f"first is {first}"
        )
    return range(int(first), int(first) + int(count))


def _parse(arguments: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="svgp_nodes.py", description=__doc__)
    parser.add_argument("--first", default="0", help="index of this host's first map node")
    parser.add_argument("--count", default=ALL, help=f"how many; {ALL}: those from the first on")
    # roslaunch adds remappings
    return parser.parse_args([word for word in arguments if ":=" not in word])


def _wait_for_core() -> None:
    """Its launch file sets the parameters; on another host we may well be there before it."""
    notice_at_s = time.monotonic() + NOTICE_S
    while _uri_of(names.CORE) is None:
        if time.monotonic() >= notice_at_s:
            uri = rosgraph.get_master_uri()
            print(f"svgp_nodes: waiting for {names.CORE} at ROS master {uri}", flush=True)
            notice_at_s = float("inf")
        time.sleep(POLL_S)


def _is_offline() -> bool:
    """Map nodes and replay take turns."""
    name = rosgraph.names.ns_join(rosgraph.names.get_ros_namespace(), names.TAKE_TURNS)
    try:
        return bool(rosgraph.Master("/svgp_nodes").getParam(name))
    except (rosgraph.MasterError, OSError):
        return False


def _watch(children: dict[int, subprocess.Popen], start_again: bool) -> str:
    """Waits until a node ends or is of no use any more; says which and why.

    start_again: those that a signal has ended, in whose place children then has the new ones.

    A master that has been started again, with another core, does not know the nodes: that core
    would feed them and never find them.
    """
    registered: set[int] = set()
    deaths = {index: Deaths(names.map_node(index)) for index in children}
    for index in itertools.cycle(list(children)):
        time.sleep(POLL_S)
        ended = [k for k, child in children.items() if child.poll() is not None]
        if ended:
            index = ended[0]
            status = children[index].returncode
            if status >= 0 or not start_again:
                break
            told = deaths[index].add(status)
            if deaths[index].too_many:
                return told
            print(f"svgp_nodes: {told}, and learns its maps from the log", flush=True)
            children[index] = _start(index, restarts=len(deaths[index]))
            continue
        try:
            uri = _uri_of(names.map_node(index))
        except ParameterError:  # the master, or the link to it, may come back
            continue
        if uri is not None:
            registered.add(index)
        elif index in registered:
            break
    try:
        # A node that ends says so to the master first.
        status = children[index].wait(PATIENCE_S)
    except subprocess.TimeoutExpired:
        uri = rosgraph.get_master_uri()
        return f"ROS master {uri} was started again, and does not know svgp_node_{index}"
    return f"svgp_node_{index} ended with exit status {status}"


def _check_not_running(indices: range) -> None:
    """A node of the same name on another host would be shut down by the master."""
    for index in indices:
        uri = _uri_of(names.map_node(index))
        if uri is not None and listens(uri):
            raise ParameterError(
                f"svgp_node_{index} runs already, at {uri}; expected each map node on one host: "
                "see local_nodes of the core's launch file, first and count of svgp_nodes.launch"
            )


def _uri_of(node: str) -> str | None:
    """Where a node is registered, if it is."""
    try:
        return uri_of(node)
    except OSError as error:
        uri = rosgraph.get_master_uri()
        raise ParameterError(f"ROS master {uri} does not answer: {error}") from None


def _command(index: int, restarts: int) -> list[str]:
    script = Path(sys.argv[0]).with_name("svgp_node.py")
    private = [f"_index:={index}", f"_restarts:={restarts}"]
    return [str(script), f"__name:={names.map_node(index)}", *private]


def _stop(children: Collection[subprocess.Popen]) -> None:
    for child in children:
        if child.poll() is None:
            child.send_signal(signal.SIGINT)
    end_s = time.monotonic() + PATIENCE_S
    for child in children:
        try:
            child.wait(max(0.0, end_s - time.monotonic()))
        except subprocess.TimeoutExpired:
            child.kill()
