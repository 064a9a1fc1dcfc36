"""A name is taken where somebody listens; who was killed stays registered and does not."""

import socket

import pytest

from rbpf_svgp_slam.protocol import running_nodes
from rbpf_svgp_slam.protocol.running_nodes import NameTaken, expect_free, running_at


@pytest.fixture
def registered(monkeypatch):
    """Addresses by name."""
    nodes = {}
    monkeypatch.setattr(running_nodes, "uri_of", nodes.get)
    return nodes


def test_a_name_is_free_unless_its_node_listens(registered):
    expect_free("survey_recorder")
    with socket.create_server(("localhost", 0)) as server:
        uri = f"http://localhost:{server.getsockname()[1]}/"
        registered["survey_recorder"] = uri
        assert running_at("survey_recorder") == uri
        with pytest.raises(NameTaken, match=f"survey_recorder runs already, at {uri}"):
            expect_free("survey_recorder")
    expect_free("survey_recorder")  # killed, and still registered


@pytest.mark.parametrize("uri", ["http://no.such.host.invalid:4711/", "http://localhost/"])
def test_an_address_that_leads_nowhere_takes_no_name(registered, uri):
    registered["player"] = uri
    expect_free("player")


def test_a_master_that_is_silent_is_left_to_who_registers(monkeypatch):
    def uri_of(node):
        raise ConnectionRefusedError

    monkeypatch.setattr(running_nodes, "uri_of", uri_of)
    expect_free("player")
