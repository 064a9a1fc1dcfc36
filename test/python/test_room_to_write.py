"""What a recorder asks of its run folder before the survey begins."""

import shutil
from pathlib import Path

import pytest

from rbpf_svgp_slam.parameters.rules import ParameterError
from rbpf_svgp_slam.recorder.room_to_write import (
    LEAST_FREE_MB,
    OF_A_RUN,
    expect_no_earlier_run,
    expect_room,
)


def test_a_folder_that_can_be_made_is_made_and_left_empty(tmp_path):
    expect_room(tmp_path / "surveys" / "one")
    assert list((tmp_path / "surveys" / "one").iterdir()) == []


@pytest.mark.parametrize("folder", ["/proc/run", "file/run"])
def test_a_folder_that_cannot_be_made_is_named_with_the_reason(tmp_path, folder):
    (tmp_path / "file").touch()
    with pytest.raises(
        ParameterError, match=f"~out is .*{folder}; expected a folder to write into"
    ):
        expect_room(tmp_path / folder)


def test_a_folder_that_takes_no_files_is_named():
    # sysfs: no file can be made there, whoever asks
    with pytest.raises(
        ParameterError, match="~out is /sys/kernel; expected a folder to write into"
    ):
        expect_room(Path("/sys/kernel"))


def test_a_disk_that_is_nearly_full_is_told_with_its_space(tmp_path, monkeypatch):
    usage = shutil.disk_usage(tmp_path)
    nearly_full = usage._replace(free=int((LEAST_FREE_MB - 1) * 1e6))
    monkeypatch.setattr(shutil, "disk_usage", lambda path: nearly_full)
    with pytest.raises(
        ParameterError, match="on whose disk 499 MB are free; expected at least 500"
    ):
        expect_room(tmp_path)


@pytest.mark.parametrize("name", OF_A_RUN)
def test_a_live_run_is_not_written_over_another(tmp_path, name):
    expect_no_earlier_run(tmp_path, offline=False)
    (tmp_path / name).touch()
    with pytest.raises(ParameterError, match=f"has {name} of an earlier run; .*overwrite:=true"):
        expect_no_earlier_run(tmp_path, offline=False)
    expect_no_earlier_run(tmp_path, offline=True)  # both can be made again from their bags


def test_a_bag_s_run_is_not_written_over_a_live_survey(tmp_path):
    (tmp_path / "survey.journal").touch()
    with pytest.raises(ParameterError, match="survey.journal of an earlier live survey"):
        expect_no_earlier_run(tmp_path, offline=True)
    # live it may be the one that the core has just begun, which refuses an earlier one itself
    expect_no_earlier_run(tmp_path, offline=False)
