"""evaluate_run.py: a folder scored again, checked by evo, and what it says of bad ones."""

import dataclasses
import json
import re
import shutil
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from made_up_survey import random_tracks, write_run

from rbpf_svgp_slam.evaluation.evaluate_run import NO_EVO, main
from rbpf_svgp_slam.metrics import metric_names
from rbpf_svgp_slam.metrics.evaluation import evaluate
from rbpf_svgp_slam.metrics.evo_errors import evo_errors
from rbpf_svgp_slam.run.tracks import write_tum

PACKAGE = Path(__file__).parents[2]
# Two programs' sums over the same doubles.
SAME = 1e-9
RELATIVE = {"rpe_rmse_m", "dr_rpe_rmse_m"}
EVO_ERRORS = tuple(
    f"{prefix}{name}"
    for prefix in ("", "dr_")
    for name in ("ate_rmse_m", "ate_aligned_rmse_m", "rpe_rmse_m")
) + ("online_ate_rmse_m", "online_ate_aligned_rmse_m")


@contextmanager
def undrawn():
    """Reports that are written anew get no figures, for tests that look at none."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("rbpf_svgp_slam.evaluation.page.draw_figures", lambda *_: ())
        yield


@pytest.fixture(scope="module")
def written(run, tmp_path_factory):
    terrain = tmp_path_factory.mktemp("terrain") / "terrain.npz"
    grid = run.terrain
    origin_m = [grid.x[0], grid.y[0]]
    np.savez(terrain, z=grid.mean, resolution_m=grid.x[1] - grid.x[0], origin_m=origin_m)
    folder = tmp_path_factory.mktemp("written") / "run"
    statistics = {**run.statistics, "terrain": str(terrain)}
    write_run(dataclasses.replace(run, statistics=statistics), folder)
    # From here on the map is its grid, interpolated: make_run's is a function, and no file's.
    with undrawn():
        assert main([str(folder), "--rewrite"]) == 0
    return folder


@pytest.fixture
def folder(written, tmp_path):
    return Path(shutil.copytree(written, tmp_path / "run"))


@pytest.fixture
def tracks_only(folder):
    for path in folder.iterdir():
        if path.suffix != ".tum":
            path.unlink()
    return folder


def edit_report(folder, **changes):
    path = folder / "report.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **changes}))


def row(output, name):
    """The cells behind the metric's name."""
    return next(line.split()[1:] for line in output.splitlines() if line.split()[:1] == [name])


def test_a_run_agrees_with_its_report_and_with_evo(folder, capsys):
    assert main([str(folder)]) == 0
    output = capsys.readouterr().out
    report = json.loads((folder / "report.json").read_text())
    for name in ("ate_rmse_m", "dr_rpe_rmse_m"):
        assert row(output, name) == [f"{report[name]:.7g}"] * 3
    assert row(output, "map_rmse_m") == [f"{report['map_rmse_m']:.7g}"] * 2
    assert "evo 1.26.3: agrees with ours in all 8 errors" in output
    assert "report.json: agrees with the recomputation in all" in output
    assert "≠" not in output


def test_the_script_passes_its_exit_status_on(folder):
    script = PACKAGE / "scripts" / "evaluate_run.py"
    for arguments, status in (([folder], 0), ([folder / "nowhere"], 2)):
        assert subprocess.run([sys.executable, script, *arguments]).returncode == status


def test_every_metric_has_its_row(run, folder, capsys):
    main([str(folder)])
    output = capsys.readouterr().out
    numbers = {
        name
        for name, value in evaluate(dataclasses.replace(run, statistics={})).report.items()
        if isinstance(value, (int, float))
    }
    assert len(numbers) > 25
    assert {name for name in numbers if not re.search(rf"^{name} ", output, re.M)} == set()
    assert numbers == {*metric_names.FROM_DATA, *metric_names.METRICS}
    assert metric_names.ERRORS < set(metric_names.METRICS)


@pytest.mark.parametrize(
    "name, factor", [("ate_rmse_m", 1.01), ("map_msll", 0.99), ("beams", 2), ("terrain_rmse_m", 0)]
)
def test_a_report_that_says_something_else_is_found(folder, capsys, name, factor):
    value = json.loads((folder / "report.json").read_text())[name]
    edit_report(folder, **{name: value * factor})
    assert main([str(folder)]) == 1
    output = capsys.readouterr().out
    assert f"report.json: DIFFERS from the recomputation in {name} (" in output
    assert row(output, name)[-1] == "≠"


@pytest.mark.parametrize("value", [None, "0.5", float("nan")])
def test_a_report_without_a_number_differs(folder, value, capsys):
    edit_report(folder, final_error_m=value)
    assert main([str(folder)]) == 1
    assert "in final_error_m (" in capsys.readouterr().out


def test_what_an_older_report_did_not_have_is_no_difference(folder, capsys):
    report = json.loads((folder / "report.json").read_text())
    del report["rpe_rmse_m"]
    (folder / "report.json").write_text(json.dumps(report))
    assert main([str(folder)]) == 0
    assert row(capsys.readouterr().out, "rpe_rmse_m")[0] == "–"


def test_changed_data_are_found_and_rewritten(folder, capsys):
    track = folder / "trajectory.tum"
    lines = track.read_text().splitlines()
    stamp, x, rest = lines[5].split(maxsplit=2)
    track.write_text("\n".join([*lines[:5], f"{stamp} {float(x) + 99} {rest}", *lines[6:]]))
    before = json.loads((folder / "report.json").read_text())
    (folder / "report.html").unlink()
    assert main([str(folder)]) == 1
    assert main([str(folder), "--rewrite"]) == 0
    assert "It has been written anew." in capsys.readouterr().out
    after = json.loads((folder / "report.json").read_text())
    assert after["ate_rmse_m"] > before["ate_rmse_m"] + 1
    assert (after["particles"], after["wall_s"]) == (100, 150.0)
    assert (folder / "report.html").stat().st_size > 100_000
    assert main([str(folder)]) == 0


def test_evo_that_says_something_else_is_found(folder, capsys, monkeypatch):
    def wrong(run, rpe_delta_s):
        errors = evo_errors(run, rpe_delta_s)
        # ten times the tolerance
        return {**errors, "dr_ate_rmse_m": errors["dr_ate_rmse_m"] * (1 + 1e-5)}

    monkeypatch.setattr("rbpf_svgp_slam.evaluation.evaluate_run.evo_errors", wrong)
    assert main([str(folder)]) == 1
    output = capsys.readouterr().out
    assert "evo 1.26.3: DIFFERS from ours in dr_ate_rmse_m (" in output
    with undrawn():
        assert main([str(folder), "--rewrite"]) == 1


def test_without_evo_the_run_is_scored(folder, capsys, monkeypatch):
    for name in ("evo", "evo.core"):
        monkeypatch.setitem(sys.modules, name, None)
    assert main([str(folder), "--json", str(folder / "scores.json")]) == 0
    output = capsys.readouterr().out
    assert len(row(output, "ate_rmse_m")) == 2
    assert "evo: not installed" in output and "pip install --no-deps evo==" in output
    assert json.loads((folder / "scores.json").read_text())["evo"] is None


def test_the_evo_to_install_is_the_one_of_tools(folder):
    requirements = (PACKAGE / "tools" / "requirements.txt").read_text().split()
    assert re.search(r"evo==[\d.]+\d", NO_EVO).group() in requirements


def test_metrics_as_json(folder):
    out = folder / "scores.json"
    assert main([str(folder), "--json", str(out)]) == 0
    scores = json.loads(out.read_text())
    report = json.loads((folder / "report.json").read_text())
    assert {**scores, "evo": None} == {**report, "evo": None}
    for name in EVO_ERRORS:
        assert scores["evo"][name] == pytest.approx(report[name], rel=SAME)


def test_evo_and_we_agree_where_truth_has_gaps(run):
    poses, truth = random_tracks(np.random.default_rng(7), len(run.stamp_s))
    other, _ = random_tracks(np.random.default_rng(8), len(run.stamp_s))
    tracks = {"estimate": poses, "online": other[::-1], "dead_reckoning": other}
    gaps = dataclasses.replace(run, **tracks, ground_truth=truth)
    report = evaluate(gaps).report
    errors = evo_errors(gaps, report["rpe_delta_s"])
    assert errors.keys() == {"version", *EVO_ERRORS}
    for name in EVO_ERRORS:
        assert errors[name] == pytest.approx(report[name], rel=SAME)


def test_evo_leaves_out_what_cannot_be_known(run):
    blind = dataclasses.replace(run, ground_truth=None)
    assert evo_errors(blind, 60.0).keys() == {"version"}
    # The survey takes some 400 s.
    assert evo_errors(run, 1e4).keys() == {"version", *EVO_ERRORS} - RELATIVE


def test_without_ground_truth_there_is_nothing_for_evo(folder, capsys):
    (folder / "ground_truth.tum").unlink()
    with undrawn():
        assert main([str(folder), "--rewrite"]) == 0
    assert "evo: no ground truth" in capsys.readouterr().out
    assert main([str(folder)]) == 0


def test_a_run_of_another_program_has_no_report(folder, capsys):
    for name in ("report.json", "report.html", "history.npz", "parameters.yaml"):
        (folder / name).unlink()
    assert main([str(folder)]) == 0
    output = capsys.readouterr().out
    assert row(output, "ate_rmse_m")[0] == "–" and len(row(output, "ate_rmse_m")) == 3
    assert "report.json: there was none." in output


def test_the_terrain_can_be_elsewhere(written, folder, tmp_path, capsys):
    terrain = json.loads((written / "report.json").read_text())["terrain"]
    edit_report(folder, terrain="/nowhere/terrain.npz")
    assert main([str(folder)]) == 0
    assert "/nowhere/terrain.npz: no such file" in capsys.readouterr().out
    moved = shutil.copy(terrain, tmp_path / "moved.npz")
    with undrawn():
        assert main([str(folder), "--terrain", str(moved), "--rewrite"]) == 0
    assert len(row(capsys.readouterr().out, "terrain_rmse_m")) == 2
    assert json.loads((folder / "report.json").read_text())["terrain"] == str(moved)


def test_trajectories_alone_are_scored(written, tracks_only, capsys):
    report = json.loads((written / "report.json").read_text())
    assert main([str(tracks_only)]) == 0
    output = capsys.readouterr().out
    for name in EVO_ERRORS:
        assert float(row(output, name)[1]) == pytest.approx(report[name], rel=1e-6)
    assert "map_rmse_m" not in output
    assert "Note" not in output
    assert main([str(tracks_only), "--rewrite"]) == 2
    assert "survey.npz: no such file" in capsys.readouterr().err
    # As the message proposes, so that they can be compared.
    assert main([str(tracks_only), "--json", str(tracks_only / "report.json")]) == 0
    assert main([str(tracks_only)]) == 0


def test_trajectories_alone_may_have_stamps_of_their_own(tmp_path, capsys):
    """Truth at 10 Hz along a straight line, where interpolation is exact."""
    stamp_s = np.arange(0, 300, 0.1)
    truth = np.zeros((len(stamp_s), 6))
    truth[:, 0] = 1.5 * stamp_s
    write_tum(tmp_path / "ground_truth.tum", stamp_s, truth)
    own_s = np.arange(0.05, 299, 0.7)
    poses = np.zeros((len(own_s), 6))
    poses[:, 0], poses[:, 1] = 1.5 * own_s, 2.0
    write_tum(tmp_path / "trajectory.tum", own_s, poses)
    assert main([str(tmp_path)]) == 0
    output = capsys.readouterr().out
    assert row(output, "ate_rmse_m")[1:] == ["2", "2"]
    assert "ground_truth.tum" not in output
    assert "dead_reckoning.tum has poses at the stamps of 0 of 428 pings" in output


def test_pings_without_a_pose_are_told(run, folder, capsys):
    lines = (folder / "trajectory.tum").read_text().splitlines()
    (folder / "trajectory.tum").write_text("\n".join(lines[:-3]))
    main([str(folder)])
    pings = len(run.stamp_s)
    expected = f"trajectory.tum has poses at the stamps of {pings - 3} of {pings} pings"
    assert expected in capsys.readouterr().out


@pytest.mark.parametrize("name", ["survey.npz", "map.npz", "trajectory.tum", "report.json"])
def test_damaged_files_are_named(folder, name, capsys):
    (folder / name).write_bytes((folder / name).read_bytes()[:1000])
    assert main([str(folder)]) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.count("\n") == 1
    assert re.match(rf"evaluate_run.py: error: .*{name}", captured.err)


def test_flipped_bytes_are_told_in_one_line(folder, capsys):
    """Compressed data that are damaged: numpy, zipfile and zlib each have errors of their own."""
    rng = np.random.default_rng(9)
    data = (folder / "survey.npz").read_bytes()
    for _ in range(10):
        damaged = bytearray(data)
        for i in rng.integers(0, len(data), 20):
            damaged[i] ^= 0xFF
        (folder / "survey.npz").write_bytes(damaged)
        assert main([str(folder)]) == 2
        assert re.fullmatch(r"evaluate_run.py: error: .*run.*\n", capsys.readouterr().err)


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"beams_per_ping": np.ones(3)}, "Cannot cast array data"),
        ({"held_out": np.zeros(3, dtype=bool)}, "held_out: expected shape"),
        ({"levelled": np.zeros((4, 3))}, "ping_of_beam: expected shape"),
        ({"stamp_s": lambda stamp_s: stamp_s[::-1]}, "stamp_s decreases"),
    ],
)
def test_arrays_of_a_wrong_shape_or_order_are_told(folder, changes, message, capsys):
    with np.load(folder / "survey.npz") as file:
        arrays = dict(file)
    for name, value in changes.items():
        arrays[name] = value(arrays[name]) if callable(value) else value
    np.savez(folder / "survey.npz", **arrays)
    assert main([str(folder)]) == 2
    assert re.fullmatch(rf"evaluate_run.py: error: .*run.*{message}.*\n", capsys.readouterr().err)


@pytest.mark.parametrize(
    "missing, message",
    [
        (["map.npz"], "map.npz: no such file"),
        (["dead_reckoning.tum"], "dead_reckoning.tum: no such file"),
        (["survey.npz", "trajectory.tum"], "trajectory.tum: no such file"),
        (["survey.npz", "ground_truth.tum"], "neither survey.npz nor ground_truth.tum"),
    ],
)
def test_missing_files_are_named(folder, missing, message, capsys):
    for name in missing:
        (folder / name).unlink()
    assert main([str(folder)]) == 2
    assert re.search(message, capsys.readouterr().err)


def test_bad_arguments_are_named(folder, tmp_path, capsys):
    assert main([str(tmp_path / "nowhere")]) == 2
    assert "nowhere: no such folder" in capsys.readouterr().err
    assert main([str(folder), "--terrain", str(tmp_path / "no.npz")]) == 2
    assert "no.npz: no such file" in capsys.readouterr().err
    assert main([str(folder), "--json", str(tmp_path / "no" / "scores.json")]) == 2
    assert "scores.json" in capsys.readouterr().err
    with pytest.raises(SystemExit) as stopped:
        main([])
    assert stopped.value.code == 2
