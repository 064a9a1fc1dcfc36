"""The map nodes of one host, with a master that is a dictionary and nodes that do nothing."""

import signal
import subprocess
import sys
import threading
import time

import psutil
import pytest

from rbpf_svgp_slam.map_node import launcher
from rbpf_svgp_slam.map_node.launcher import share_of_host
from rbpf_svgp_slam.parameters.loading import ParameterError


@pytest.fixture
def master(monkeypatch):
    """Addresses by name."""
    nodes = {}
    monkeypatch.setattr(launcher, "_uri_of", nodes.get)
    monkeypatch.setattr(launcher, "POLL_S", 0.01)
    monkeypatch.setattr(launcher, "PATIENCE_S", 0.1)
    return nodes


@pytest.fixture
def children():
    children = {k: subprocess.Popen(["sleep", "60"]) for k in (2, 3)}
    yield children
    for child in children.values():
        child.kill()
        child.wait()


def test_a_node_that_ends_is_named(master, children):
    children[3].terminate()
    message = launcher._watch(children, start_again=False)
    assert message == "svgp_node_3 ended with exit status -15"


def test_a_node_that_is_killed_is_started_again(master, children, monkeypatch, capsys):
    started = []

    def start(index, restarts):
        started.append((index, restarts))
        # the second one ends by itself
        return subprocess.Popen(["sleep", "60"] if len(started) == 1 else ["false"])

    monkeypatch.setattr(launcher, "_start", start)
    children[3].kill()
    watch = threading.Thread(target=launcher._watch, args=(children, True), daemon=True)
    watch.start()
    deadline_s = time.monotonic() + 20.0
    while not started and time.monotonic() < deadline_s:
        time.sleep(0.01)
    time.sleep(0.1)
    assert watch.is_alive() and children[3].poll() is None
    children[3].kill()
    watch.join(20.0)
    assert started == [(3, 1), (3, 2)] and not watch.is_alive()
    assert "svgp_node_3 was killed by SIGKILL: it is started again" in capsys.readouterr().out


def test_a_node_that_is_killed_again_and_again_is_given_up(master, children, monkeypatch):
    monkeypatch.setattr(
        launcher, "_start", lambda *_, **__: subprocess.Popen(["sh", "-c", "kill -11 $$"])
    )
    children[2].kill()
    message = launcher._watch(children, start_again=True)
    assert message == "svgp_node_2 was killed by SIGSEGV, 5 times within 60 s: it is given up"


def test_a_master_that_was_started_again_is_noticed(master, children, monkeypatch):
    # of nodes 2 and 3 in turn: not yet registered, registered, no answer, one forgotten
    looks = iter([None, None, "http://2", "http://3", ParameterError(), "http://3", "uri", None])

    def uri_of(name):
        found = next(looks)
        if isinstance(found, Exception):
            raise found
        return found

    monkeypatch.setattr(launcher, "_uri_of", uri_of)
    message = launcher._watch(children, start_again=True)
    assert message.endswith("was started again, and does not know svgp_node_3")


def test_a_node_that_runs_elsewhere_is_left_alone(master, monkeypatch):
    alive = {"http://elsewhere"}
    monkeypatch.setattr(launcher, "listens", lambda uri: uri in alive)
    launcher._check_not_running(range(2))
    master["svgp_node_1"] = "http://elsewhere"
    with pytest.raises(ParameterError, match="svgp_node_1 runs already, at http://elsewhere"):
        launcher._check_not_running(range(2))
    alive.clear()  # killed, and still registered
    launcher._check_not_running(range(2))


def test_a_host_starts_all_nodes_or_some():
    assert share_of_host("0", "all", 3) == range(0, 3)
    assert share_of_host("0", "1", 3) == range(0, 1)
    assert share_of_host("1", "all", 3) == range(1, 3)
    assert share_of_host("2", "1", 3) == range(2, 3)


@pytest.mark.parametrize(
    "first, count, message",
    [
        ("3", "all", "first is 3; expected an integer in 0 .. 2: rbpf_svgp_slam/nodes is 3"),
        ("-1", "all", "first is -1; expected an integer in 0 .. 2"),
        ("one", "all", "first is one; expected an integer in 0 .. 2"),
        ("0", "0", "count is 0; expected all or an integer in 1 .. 3"),
        ("2", "2", "count is 2; expected all or an integer in 1 .. 1: .* first is 2"),
        ("0", "true", "count is true; expected all or an integer in 1 .. 3"),
    ],
)
def test_a_share_of_nodes_that_does_not_exist_is_refused(first, count, message):
    with pytest.raises(ParameterError, match=message):
        share_of_host(first, count, 3)


STUBBORN = "import signal, time; signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
STUBBORN += "print('begun', flush=True)\nwhile True: time.sleep(1)"


def test_stubborn_nodes_are_killed_within_one_patience(monkeypatch):
    monkeypatch.setattr(launcher, "PATIENCE_S", 0.5)
    command = [sys.executable, "-c", STUBBORN]
    nodes = [subprocess.Popen(command, stdout=subprocess.PIPE) for _ in range(4)]
    for node in nodes:
        node.stdout.readline()
    started_s = time.monotonic()
    launcher._stop(nodes)
    # one patience for each would be 2 s; a busy machine may take some tenths to start the kills
    assert time.monotonic() - started_s < 1.5
    for node in nodes:
        assert node.wait(5.0) == -signal.SIGKILL
        node.stdout.close()


def test_nodes_do_not_outlive_a_group_that_is_killed():
    group = "import subprocess, sys, time; from rbpf_svgp_slam.map_node import launcher\n"
    group += f"node = subprocess.Popen([sys.executable, '-c', {STUBBORN!r}],"
    group += " preexec_fn=launcher.end_with_parent)\n"
    group += "print(node.pid, flush=True); time.sleep(60)"
    parent = subprocess.Popen([sys.executable, "-c", group], stdout=subprocess.PIPE, text=True)
    lines = sorted(parent.stdout.readline().strip() for _ in range(2))
    assert lines[1] == "begun"
    node = psutil.Process(int(lines[0]))
    parent.kill()
    parent.wait()
    parent.stdout.close()
    try:
        # an orphan goes to init, which may take its time to bury it
        assert node.wait(10.0) is None or node.status() == psutil.STATUS_ZOMBIE
    except psutil.TimeoutExpired:
        assert node.status() == psutil.STATUS_ZOMBIE
