"""A master that dies, and another in its place; on a port of their own."""

import socket
from contextlib import contextmanager

import pytest
import rosgraph
from rosmaster.master import Master

from rbpf_svgp_slam.recorder.lost_master import lost_master

NODE = "/survey_recorder"


@pytest.fixture(name="port")
def free_port(monkeypatch):
    with socket.socket() as one:
        one.bind(("localhost", 0))
        port = one.getsockname()[1]
    monkeypatch.setenv("ROS_MASTER_URI", f"http://localhost:{port}")
    return port


@contextmanager
def running_master(port):
    master = Master(port=port)
    master.start()
    try:
        yield
    finally:
        master.stop()


def test_a_master_is_lost_once_it_has_died_or_has_forgotten_the_node(port):
    with running_master(port):
        rosgraph.Master(NODE).registerSubscriber("/odom", "*", "http://localhost:1/")
        assert lost_master(NODE) == ""
    assert lost_master(NODE) == f"the master at http://localhost:{port} has died"
    with running_master(port):
        assert "was started anew and knows none" in lost_master(NODE)


def test_a_master_that_cannot_be_reached_may_come_back(monkeypatch):
    monkeypatch.setenv("ROS_MASTER_URI", "http://no.such.host.invalid:11311")
    assert lost_master(NODE) == ""
