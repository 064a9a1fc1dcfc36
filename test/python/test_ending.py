"""Whom the recorder waits for at the end of a launch, and what it says of a run that failed."""

import resource
from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest

from rbpf_svgp_slam.recorder import ending
from rbpf_svgp_slam.run.tracks import write_tum


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


class Truth:
    """A ground truth of one pose."""

    def save(self, path):
        write_tum(path, np.ones(1), np.array([[1.0, 2.0, 3.0, 0.0, 0.0, 0.0]]))


@contextmanager
def full_disk():
    """In its place: no file may grow beyond a few bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_run_that_failed_has_a_way_out_if_it_has_a_journal(tmp_path):
    assert ending.way_out(tmp_path, Truth()) == ""
    assert not list(tmp_path.iterdir())
    (tmp_path / "survey.journal").touch()
    assert f"recover_run.py {tmp_path} makes one" in ending.way_out(tmp_path, Truth())
    assert "2.000000000" in (tmp_path / "ground_truth.tum").read_text()


def test_on_a_full_disk_it_is_told_all_the_same_and_the_last_good_file_stays(tmp_path):
    (tmp_path / "survey.journal").touch()
    (tmp_path / "ground_truth.tum").write_text("of an earlier attempt")
    with full_disk():
        told = ending.way_out(tmp_path, Truth())
    assert f"slam.launch resume:={tmp_path} goes on" in told
    assert (tmp_path / "ground_truth.tum").read_text() == "of an earlier attempt"
    assert len(list(tmp_path.iterdir())) == 2, "what was written aside"
