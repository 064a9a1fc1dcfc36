"""An experiment's use of the machine: measured, drawn, and beside another load."""

import subprocess
import sys
import time

import numpy as np
import psutil
import pytest

from rbpf_svgp_slam.experiments.figures import resource_figure, smoothed
from rbpf_svgp_slam.experiments.load import busy_core
from rbpf_svgp_slam.experiments.resources import Monitor, Usage, group_of

pytestmark = pytest.mark.alone

# Prints a line once it has begun, so that a test does not measure python's start.
BUSY = "print('begun', flush=True)\nwhile True: pass"


@pytest.mark.parametrize(
    "command, group",
    [
        (["/x/lib/rbpf_svgp_slam/rbpf_core", "__name:=rbpf_core"], "rbpf_core"),
        (["/x/rbpf_offline", "__name:=rbpf_core"], "rbpf_core"),
        (["python3", "/x/svgp_nodes.py", "__name:=svgp_nodes"], "map nodes"),
        (["python3", "/x/svgp_node.py", "__name:=svgp_node_3"], "map nodes"),
        (["python3", "/x/survey_recorder.py"], "recorder"),
        (["/opt/ros/lib/rosbag/play", "--quiet"], "player"),
        (["python3", "/usr/bin/rosmaster"], "ROS"),
    ],
)
def test_processes_are_told_apart(command, group):
    assert group_of(command) == group


def test_the_monitor_sees_children_and_what_they_use():
    parent = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {BUSY!r}])"
    with subprocess.Popen([sys.executable, "-c", parent], stdout=subprocess.PIPE) as process:
        process.stdout.readline()
        monitor = Monitor(process.pid, 0.2)
        time.sleep(2.0)
        usage = monitor.stop()
        for child in psutil.Process(process.pid).children(recursive=True):
            child.kill()
        process.wait()
    assert len(usage.wall_s) >= 2 and np.all(np.diff(usage.wall_s) > 0)
    # One child that never rests has at most one core; how much of it, the machine's load decides.
    assert 0.0 < usage.cores["ROS"].mean() <= 1.2
    # An interpreter takes some megabytes.
    assert 2.0 < usage.rss_mb["ROS"].max() < 200.0


def test_usage_is_read_back(tmp_path):
    usage = Usage(np.arange(3.0), {"map nodes": np.ones(3)}, {"map nodes": np.full(3, 250.0)})
    usage.save(tmp_path / "resources.npz")
    again = Usage.load(tmp_path / "resources.npz")
    np.testing.assert_array_equal(again.wall_s, usage.wall_s)
    assert list(again.cores) == list(again.rss_mb) == ["map nodes"]
    np.testing.assert_array_equal(again.rss_mb["map nodes"], 250.0)


def test_the_other_load_is_busy_for_its_share():
    with busy_core(0.5):
        time.sleep(1.5)  # its start
        (child,) = [c for c in psutil.Process().children() if "spawn_main" in " ".join(c.cmdline())]
        before, start_s = child.cpu_times(), time.monotonic()
        time.sleep(4.0)
        after, elapsed_s = child.cpu_times(), time.monotonic() - start_s
    share = (after.user + after.system - before.user - before.system) / elapsed_s
    # Never more than its half, but for a period cut in two; less where others want the core, too.
    assert 0.05 < share < 0.65
    assert not child.is_running()
    with busy_core(0.0):
        assert not [c for c in psutil.Process().children() if "spawn_main" in str(c.cmdline())]


def test_smoothing_keeps_a_constant_to_its_ends():
    np.testing.assert_allclose(smoothed(np.full(40, 3.0)), 3.0)
    assert len(smoothed(np.ones(3))) == 3


def test_the_resource_figure_has_all_groups():
    series = {name: np.ones(20) for name in ("map nodes", "rbpf_core")}
    figure = resource_figure(Usage(np.arange(20.0), series, series))
    labels = {text.get_text() for text in figure.axes[0].get_legend().get_texts()}
    assert labels == {"map nodes", "rbpf_core"}
    assert [axes.get_ylabel() for axes in figure.axes] == ["cores busy", "resident memory (GB)"]
