"""Core and map nodes on two hosts, which ROS services connect and 20 ms of delay each way part."""

import re
import subprocess
import time
from contextlib import contextmanager

import pytest
import yaml

from bench.network.hosts import impediment, two_hosts
from bench.ros_session import running, wait_until

IMPEDIMENT = impediment()
pytestmark = [
    pytest.mark.alone,
    pytest.mark.skipif(IMPEDIMENT != "", reason=f"two hosts: {IMPEDIMENT}"),
]
DELAY_S = 0.02
# Tiny maps; every prompt that tells particles apart resamples.
CONFIG = {
    "particles": 5,
    # played ten times too fast without /clock
    "clock": {"max_ahead_s": 1e4},
    "nodes": 2,
    "motion": {"surge_std_m": 0.3, "sway_std_m": 0.3},
    "mapping": {"hold_back_s": 5.0},
    "map": {"publish_period_s": 0.0},
    "svgp": {
        "inducing_points": 64,
        "minibatch_size": 100,
        "convergence": {"window": 20, "tolerance": 1.0},
    },
    "lc": {"rate_hz": 1.0, "min_overlap": 0.1, "mapped_variance": 0.5, "veto_sigma": 20.0},
    "resampling": {"threshold": 1.0},
}


@pytest.fixture(scope="module")
def hosts():
    with two_hosts(DELAY_S) as (first, second, _):
        yield first, second


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("two_hosts")
    simulate = ["rosrun", "rbpf_svgp_slam", "simulate_survey.py", "--mission", "demo"]
    subprocess.run([*simulate, "--scale", "0.05", "--out", folder / "survey.bag"], check=True)
    (folder / "config.yaml").write_text(yaml.safe_dump(CONFIG))
    return folder


@contextmanager
def launched(host, log, file, *arguments):
    """A shipped launch file, running on a host."""
    command = host.command("roslaunch", "--no-summary", "--wait", "rbpf_svgp_slam", file)
    if file == "slam.launch":  # it brings the master
        command.remove("--wait")
    with running([*command, *arguments], log, host.environment()) as process:
        yield process


def run_on(host, *words, timeout_s=60):
    """A command's output."""
    pipes = {"capture_output": True, "text": True, "timeout": timeout_s}
    return subprocess.run(host.command(*words), env=host.environment(), check=True, **pipes).stdout


def has_master(host):
    """The core's launch file has brought one."""
    command = host.command("rosparam", "list")
    return subprocess.run(command, env=host.environment(), capture_output=True).returncode == 0


def latest(host, topic):
    """The next message of a topic, as a dictionary."""
    return next(yaml.safe_load_all(run_on(host, "rostopic", "echo", "-n", "1", topic)))


def survey(host, folder):
    """Play the bag on the core's host; what core and map nodes then say of themselves."""
    wait_until(lambda: has_master(host), "the ROS master")
    latest(host, "/svgp_node_1/status")
    play = ["rosbag", "play", "-q", "-r", "10", "--queue", "10000", "--wait-for-subscribers"]
    run_on(host, *play, folder / "survey.bag", "--topics", "/odom", "/mbes/pings", "/tf_static")
    time.sleep(1.0)
    steps = [latest(host, f"/svgp_node_{k}/status")["steps"] for k in range(2)]
    return latest(host, "/rbpf_core/status"), steps


def check(host, folder, logs):
    """A survey with nothing lost, loop closures, and maps that followed their particles."""
    status, steps = survey(host, folder)
    output = "".join(log.read_text() for log in logs)
    assert (status["pings_dropped"], status["pings_rejected"]) == (0, 0)
    assert status["pings"] > 250
    assert status["prompts"] > 0, status
    assert status["epoch"] > 0, status
    assert status["maps_moved"] > 0, status
    assert status["resamplings_failed"] == 0, status
    assert min(steps) > 50, steps
    assert not re.search("ERROR|failed|refused", output), output


def test_the_link_takes_its_time(hosts):
    first, second = hosts
    listen = "import socket; socket.create_server(('', 5000)).accept()[0].recv(1)"
    connect = (
        "import socket, time; t = time.monotonic(); "
        f"socket.create_connection(('{second.address}', 5000)); print(time.monotonic() - t)"
    )
    server = subprocess.Popen(second.command("python3", "-c", listen))
    time.sleep(0.5)
    round_trip_s = float(run_on(first, "python3", "-c", connect))
    assert server.wait(5) == 0
    # at most: two processes of this machine may have to wait for a processor
    assert 2 * DELAY_S <= round_trip_s < 2 * DELAY_S + 0.05


def test_all_map_nodes_on_another_host(hosts, folder):
    core, other = hosts
    args = [f"config:={folder}/config.yaml", f"survey:={folder}/survey.survey.yaml"]
    logs = [folder / "all_core.log", folder / "all_nodes.log"]
    with launched(other, logs[1], "svgp_nodes.launch"):
        with launched(core, logs[0], "slam.launch", *args, "local_nodes:=0"):
            check(core, folder, logs)


def test_map_nodes_on_both_hosts(hosts, folder):
    core, other = hosts
    args = [f"config:={folder}/config.yaml", f"survey:={folder}/survey.survey.yaml"]
    logs = [folder / "split_core.log", folder / "split_nodes.log"]
    with launched(core, logs[0], "slam.launch", *args, "local_nodes:=1"):
        with launched(other, logs[1], "svgp_nodes.launch", "first:=1"):
            check(core, folder, logs)
            # one launch too many must not harm the nodes that run
            command = other.command("rosrun", "rbpf_svgp_slam", "svgp_nodes.py")
            again = subprocess.run(
                command, env=other.environment(), capture_output=True, text=True, timeout=30
            )
            assert again.returncode != 0
            assert "svgp_node_0 runs already, at http://10." in again.stderr
            assert latest(core, "/svgp_node_0/status")["steps"] > 0
