"""Files that are written aside and put in place whole."""

import os

import pytest

from rbpf_svgp_slam.run.aside import written_aside


def contents(folder):
    return {path.name: path.read_text() for path in folder.iterdir()}


def test_files_come_whole_and_what_is_not_written_again_goes(tmp_path):
    folder = tmp_path / "run"  # not there yet
    with written_aside(folder) as aside:
        (aside / "kept").write_text("new")
        (aside / "lacking").write_text("new")
        assert all(path.is_dir() for path in folder.iterdir()), "nothing before the end"
    (folder / "others").write_text("of somebody else")
    with written_aside(folder, may_lack=("lacking", "never_there")) as aside:
        (aside / "kept").write_text("newer")
        assert (folder / "kept").read_text() == "new"
    assert contents(folder) == {"kept": "newer", "others": "of somebody else"}


def test_what_fails_leaves_the_folder_as_it_was(tmp_path):
    (tmp_path / "kept").write_text("old")
    (tmp_path / "lacking").write_text("old")
    with pytest.raises(OSError, match="disk full"):
        with written_aside(tmp_path, may_lack=("lacking",)) as aside:
            (aside / "kept").write_text("half")
            raise OSError("disk full")
    assert contents(tmp_path) == {"kept": "old", "lacking": "old"}


def test_files_are_on_the_disk_before_they_have_their_names(tmp_path, monkeypatch):
    done = []
    fsync, replace = os.fsync, os.replace

    def note_fsync(descriptor):
        done.append(("synced", os.path.basename(os.readlink(f"/proc/self/fd/{descriptor}"))))
        fsync(descriptor)

    def note_replace(source, target):
        done.append(("named", os.path.basename(target)))
        replace(source, target)

    monkeypatch.setattr(os, "fsync", note_fsync)
    monkeypatch.setattr(os, "replace", note_replace)
    with written_aside(tmp_path / "run") as aside:
        for name in ("a", "b"):
            (aside / name).write_text(name)
    expected = [("synced", "a"), ("synced", "b"), ("named", "a"), ("named", "b"), ("synced", "run")]
    assert done == expected
