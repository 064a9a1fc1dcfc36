"""The map nodes of one host, with a master that is a dictionary and nodes that do nothing."""

import subprocess

import pytest

from rbpf_svgp_slam.ros import node_group
from rbpf_svgp_slam.ros.node_group import share_of_host
from rbpf_svgp_slam.ros.parameters import ParameterError


@pytest.fixture
def master(monkeypatch):
    """Addresses by name."""
    nodes = {}
    monkeypatch.setattr(node_group, "_uri_of", nodes.get)
    monkeypatch.setattr(node_group, "POLL_S", 0.01)
    monkeypatch.setattr(node_group, "PATIENCE_S", 0.1)
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
    assert node_group._watch(children) == "svgp_node_3 ended with exit status -15"


def test_a_master_that_was_started_again_is_noticed(master, children, monkeypatch):
    # of nodes 2 and 3 in turn: not yet registered, registered, no answer, one forgotten
    looks = iter([None, None, "http://2", "http://3", ParameterError(), "http://3", "uri", None])

    def uri_of(name):
        found = next(looks)
        if isinstance(found, Exception):
            raise found
        return found

    monkeypatch.setattr(node_group, "_uri_of", uri_of)
    message = node_group._watch(children)
    assert message.endswith("was started again, and does not know svgp_node_3")


def test_a_node_that_runs_elsewhere_is_left_alone(master, monkeypatch):
    alive = {"http://elsewhere"}
    monkeypatch.setattr(node_group, "_answers", lambda uri: uri in alive)
    node_group._check_not_running(range(2))
    master["svgp_node_1"] = "http://elsewhere"
    with pytest.raises(ParameterError, match="svgp_node_1 runs already, at http://elsewhere"):
        node_group._check_not_running(range(2))
    alive.clear()  # killed, and still registered
    node_group._check_not_running(range(2))


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
