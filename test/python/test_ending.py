"""Whom the recorder waits for at the end of a launch."""

from types import SimpleNamespace

import pytest

from rbpf_svgp_slam.recorder import ending


@pytest.mark.parametrize(
    "command, ends_last",
    [
        (["/usr/bin/python3", "/usr/bin/rosmaster", "--core", "-p", "11311"], True),
        (["/usr/lib/rosout/rosout", "__name:=rosout", "__log:=/log/rosout-1.log"], True),
        (["/lib/rbpf_svgp_slam/rbpf_core", "__name:=rbpf_core", "__log:=/rosout"], False),
        (["/usr/bin/python3", "/lib/rbpf_svgp_slam/svgp_nodes.py", "--first", "0"], False),
        ([], False),
    ],
)
def test_roslaunch_ends_its_own_processes_after_the_recorder(command, ends_last):
    process = SimpleNamespace(cmdline=lambda: command)
    assert ending._ends_last(process) == ends_last
