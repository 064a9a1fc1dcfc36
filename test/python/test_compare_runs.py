"""compare_runs.py: reports side by side."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from rbpf_svgp_slam.evaluation.compare_runs import (
    draw_position_errors,
    load_runs,
    main,
    short_names,
)
from rbpf_svgp_slam.run.tracks import write_tum

PACKAGE = Path(__file__).parents[2]
PARAMETERS = {"particles": 40, "seed": 1, "svgp": {"kernel": "matern12", "inducing_points": 400}}
REPORT = {
    "particles": 40,
    "seed": 1,
    "pings": 1200,
    "beams": 300_000,
    "wall_s": 61.25,
    "ate_rmse_m": 2.0,
    "dr_ate_rmse_m": 6.0,
    "map_rmse_m": 0.25,
    "map_msll": -1.5,
    "map_coverage": 1.0,
    "final_error_m": None,
    "consistency": {"resolution_m": 1.0},
    "notes": ["a note"],
}


def make_folder(path, parameters=PARAMETERS, error_m=(2.0, 6.0), **report):
    """A run folder as far as comparisons read it, whose tracks err by constant offsets."""
    path.mkdir(parents=True)
    (path / "report.json").write_text(json.dumps({**REPORT, **report}))
    if parameters is not None:
        (path / "parameters.yaml").write_text(yaml.safe_dump(parameters))
    stamp_s = 1.6e9 + 0.5 * np.arange(50)
    poses = np.zeros((50, 6))
    poses[:, 0] = 0.7 * np.arange(50)
    write_tum(path / "ground_truth.tum", stamp_s, poses)
    for name, offset_m in zip(("trajectory", "dead_reckoning"), error_m):
        write_tum(path / f"{name}.tum", stamp_s, poses + [0, offset_m, 0, 0, 0, 0])
    return path


@pytest.fixture
def folders(tmp_path):
    """The second run has another kernel, and a worse track but a better map."""
    other = {**PARAMETERS, "svgp": {"kernel": "matern32", "inducing_points": 400}}
    worse = dict(ate_rmse_m=3.0, map_rmse_m=0.125, wall_s=1234.5)
    return [
        make_folder(tmp_path / "first"),
        make_folder(tmp_path / "second", other, error_m=(3.0, 6.0), **worse),
    ]


def table(folders, capsys):
    """The printed rows by name, and all that was printed."""
    assert main([str(folder) for folder in folders]) == 0
    output = capsys.readouterr().out
    rows = [re.split(r" *\| *", line)[1:-1] for line in output.splitlines() if line[:1] == "|"]
    return {row[0]: row[1:] for row in rows}, output


def test_settings_that_differ_come_first_then_counters_and_metrics(folders, capsys):
    rows, _ = table(folders, capsys)
    names = list(rows)
    assert rows[""] == ["first", "second"]
    assert re.fullmatch("-+", names[1])
    assert names[2:6] == ["svgp/kernel", "pings", "beams", "particles"]
    assert rows["svgp/kernel"] == ["matern12", "matern32"]
    assert "svgp/inducing_points" not in rows
    assert rows["wall_s"] == ["61.2", "1\u202f234"]
    # Known to neither, or no number.
    assert not {"final_error_m", "consistency", "notes"} & set(rows)


def test_the_lowest_error_is_bold(folders, capsys):
    rows, _ = table(folders, capsys)
    assert rows["ate_rmse_m"] == ["**2**", "3"]
    assert rows["map_rmse_m"] == ["0.25", "**0.125**"]
    # The same in both, no error of the filter's, or no error at all.
    for name in ("map_msll", "dr_ate_rmse_m", "map_coverage", "wall_s"):
        assert "*" not in "".join(rows[name])


def test_what_reads_the_same_as_the_lowest_is_bold_too(folders, tmp_path, capsys):
    folders.append(make_folder(tmp_path / "third", ate_rmse_m=1.9999, map_msll=-2.0))
    rows, _ = table(folders, capsys)
    assert rows["ate_rmse_m"] == ["**2**", "3", "**2**"]
    assert rows["map_msll"] == ["-1.5", "-1.5", "**-2**"]


def test_missing_values_are_dashes(folders, tmp_path, capsys):
    # The run of another program: no parameters; a metric of its own.
    folders.append(make_folder(tmp_path / "third", None, ate_rmse_m=None, its_own_m=0.5))
    rows, output = table(folders, capsys)
    assert rows["svgp/kernel"] == ["matern12", "matern32", "–"]
    assert rows["ate_rmse_m"] == ["**2**", "3", "–"]
    assert list(rows)[-1] == "its_own_m" and rows["its_own_m"] == ["–", "–", "0.5"]
    # It says nothing about parameters, so that these do not differ for its sake.
    assert "svgp/inducing_points" not in rows


def test_a_setting_that_one_run_does_not_have_differs(folders, tmp_path, capsys):
    folders.append(make_folder(tmp_path / "third", {**PARAMETERS, "seed": 2, "lc": {"rate_hz": 1}}))
    rows, output = table(folders, capsys)
    assert rows["lc/rate_hz"] == ["–", "–", "1"]
    # A parameter that is a counter as well stands once.
    assert rows["seed"] == ["1", "1", "2"]
    assert len(re.findall(r"^\| seed ", output, re.M)) == 1


def test_runs_of_different_surveys_are_warned_of(folders, tmp_path, capsys):
    assert "Warning" not in table(folders, capsys)[1]
    # Trajectories alone: no beams, perhaps of the same survey.
    assert "Warning" not in table([*folders, make_folder(tmp_path / "tracks", beams=0)], capsys)[1]
    folders.append(make_folder(tmp_path / "third", beams=299_999))
    output = table(folders, capsys)[1]
    assert output.splitlines()[-1].startswith("Warning: these are not runs of the same survey")
    assert "beams 300\u202f000, 300\u202f000, 299\u202f999" in output and "pings 1" not in output
    assert "**" not in output  # of different tasks none is the best


def test_bars_and_lines_in_values_do_not_break_the_table(folders, tmp_path, capsys):
    folders.append(make_folder(tmp_path / "third", {**PARAMETERS, "frames": "a|b\nc"}))
    output = table(folders, capsys)[1]
    assert "a\\|b c |" in output


def test_names_are_the_shortest_that_tell_folders_apart(tmp_path, monkeypatch):
    (tmp_path / "a").mkdir()
    monkeypatch.chdir(tmp_path / "a")
    folders = [Path("/x/1/run"), Path("/x/2/run"), Path("/y/2/run"), Path("/x/other"), Path(".")]
    assert short_names(folders) == ["1/run", "x/2/run", "y/2/run", "other", "a"]


def test_table_and_figure_are_written(folders, tmp_path, capsys):
    out, figure = tmp_path / "table.md", tmp_path / "errors.png"
    arguments = [*map(str, folders), "--out", str(out), "--figure", str(figure)]
    assert main(arguments) == 0
    assert out.read_text() == capsys.readouterr().out
    assert figure.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_the_figure_shows_every_run_and_one_dead_reckoning(folders, tmp_path):
    blind = make_folder(tmp_path / "blind")
    (blind / "ground_truth.tum").unlink()
    figure, left_out = draw_position_errors(load_runs([blind, *folders]))
    assert left_out == ["blind"]
    lines = {line.get_label(): line for line in figure.axes[0].lines}
    assert list(lines) == ["dead reckoning of first", "first", "second"]
    for line, error_m in zip(lines.values(), (6.0, 2.0, 3.0)):
        # Nine decimals of a TUM file.
        np.testing.assert_allclose(line.get_ydata(), error_m, atol=1e-8)
        np.testing.assert_allclose(line.get_xdata(), np.arange(50) * 0.5 / 60, atol=1e-6)


def test_a_figure_that_cannot_be_drawn_is_told(folders, tmp_path, capsys):
    arguments = [*map(str, folders), "--figure"]
    assert main([*arguments, str(tmp_path / "errors.xyz")]) == 2
    assert "xyz" in capsys.readouterr().err
    for folder in folders:
        (folder / "ground_truth.tum").unlink()
    assert main([*arguments, str(tmp_path / "errors.png")]) == 2
    assert "no run has ground truth" in capsys.readouterr().err
    assert not (tmp_path / "errors.png").exists()


def test_bad_folders_are_named_in_one_line(folders, tmp_path, capsys):
    good, bad = folders

    def error(*arguments):
        assert main([str(argument) for argument in arguments]) == 2
        captured = capsys.readouterr()
        assert captured.out == "" and captured.err.count("\n") == 1
        return captured.err

    assert "nowhere: no such folder" in error(good, tmp_path / "nowhere")
    assert "expected two run folders" in error(good)
    assert "all different" in error(good, bad, good)
    (bad / "parameters.yaml").write_text("a: [")
    assert "second/parameters.yaml: expected names and values" in error(good, bad)
    (bad / "parameters.yaml").unlink()
    (bad / "report.json").write_text("[1, 2]")
    assert "second/report.json: expected names and values, got list" in error(good, bad)
    (bad / "report.json").write_text("{")
    assert "second/report.json: expected names and values" in error(good, bad)
    (bad / "report.json").unlink()
    assert "second/report.json: no such file; evaluate_run.py --rewrite" in error(good, bad)


def test_the_script_passes_its_exit_status_on(folders):
    script = PACKAGE / "scripts" / "compare_runs.py"
    for arguments, status in ((folders, 0), (folders[:1], 2)):
        assert subprocess.run([sys.executable, script, *arguments]).returncode == status
