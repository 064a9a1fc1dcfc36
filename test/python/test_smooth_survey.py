"""smooth_survey.py: folders adjusted, ours and another program's; and what it says of bad ones."""

import dataclasses
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from made_up_survey import write_run

from rbpf_svgp_slam.evaluation.evaluate_run import main as evaluate_run
from rbpf_svgp_slam.evaluation.smooth_survey import main
from rbpf_svgp_slam.metrics.trajectory_errors import ate_rmse
from rbpf_svgp_slam.run.fixes import Fixes
from rbpf_svgp_slam.run.run_files import load_run
from rbpf_svgp_slam.smoothing import smooth_run as smoothing
from rbpf_svgp_slam.smoothing.smoothing_parameters import smoothing_params

SCRIPT = Path(__file__).parents[2] / "scripts" / "smooth_survey.py"
WRITTEN = (
    "trajectory.tum dead_reckoning.tum ground_truth.tum closures.npz map.npz seabed.npz survey.npz "
    "parameters.yaml report.json report.html"
).split()


@pytest.fixture(scope="module")
def written(run, tmp_path_factory):
    folder = tmp_path_factory.mktemp("written") / "run"
    write_run(run, folder)
    return folder


@pytest.fixture
def folder(written, tmp_path):
    return Path(shutil.copytree(written, tmp_path / "run"))


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def report_of(folder):
    return json.loads((folder / "report.json").read_text())


@pytest.fixture(scope="module")
def smoothed(written, tmp_path_factory):
    """What the command says, and the folder that it has written."""
    folder = Path(shutil.copytree(written, tmp_path_factory.mktemp("smoothed") / "run"))
    before = contents(folder)
    output = subprocess.run(
        [sys.executable, SCRIPT, folder], capture_output=True, text=True, check=True
    ).stdout
    assert contents(folder) == before
    return output, folder / "smoothed"


def test_a_run_is_adjusted_into_a_folder_of_its_own(run, smoothed):
    output, folder = smoothed
    assert {path.name for path in folder.iterdir()} > set(WRITTEN)
    report = report_of(folder)
    assert report["ate_rmse_m"] < 0.4 * report["dr_ate_rmse_m"]
    assert report["closures_accepted"] > 30 and report["closures_wrong"] == 0
    # Of one small survey: between far too sure and far too shy.
    assert 0.1 < report["nees"] < 5
    assert report["ideal_ate_rmse_m"] < report["ate_rmse_m"]
    expected = (
        rf"{report['closures_accepted']} closures accepted; .* refused; 0 wrong\. "
        rf"ATE \d\.\d\d m before, {report['ate_rmse_m']:.2f} m after "
        rf"\(DR {report['dr_ate_rmse_m']:.2f} m, ideal {report['ideal_ate_rmse_m']:.2f} m\)\. "
        rf"\d+\.\d s of one processor\.\nReport: .*smoothed/report\.html\n"
    )
    assert re.fullmatch(expected, output)


def test_height_and_attitude_are_dead_reckonings_and_covariances_grow(smoothed):
    again = load_run(smoothed[1])
    np.testing.assert_allclose(again.estimate[:, 2:5], again.dead_reckoning[:, 2:5], atol=1e-8)
    variance = again.estimate_covariance[:, 0] + again.estimate_covariance[:, 3]
    assert variance[0] < 0.01 < variance.max()
    assert np.isfinite(again.closures.shift).all()


def test_the_map_is_the_seabed_of_the_adjusted_track(smoothed):
    report = report_of(smoothed[1])
    assert report["map_rmse_m"] == pytest.approx(report["seabed_rmse_m"], rel=0.05)
    assert report["seabed_rmse_m"] < 0.3
    assert report["smoothed_from"].endswith("run") and report["particles"] is None


def test_what_is_written_agrees_with_its_report(smoothed, capsys):
    assert evaluate_run([str(smoothed[1])]) == 0
    assert "agrees with the recomputation in all" in capsys.readouterr().out


def test_a_run_of_another_program_is_adjusted(folder, tmp_path, capsys):
    for name in ("report.json", "report.html", "history.npz", "parameters.yaml", "closures.npz"):
        (folder / name).unlink()
    (folder / "ground_truth.tum").unlink()
    with np.load(folder / "survey.npz") as file:
        needed = {k: file[k] for k in ("stamp_s", "held_out", "beams_per_ping", "levelled")}
    np.savez(folder / "survey.npz", **needed)
    # Dead reckoning that ends early, and beams that are none.
    lines = (folder / "dead_reckoning.tum").read_text().splitlines()
    (folder / "dead_reckoning.tum").write_text("\n".join(lines[:-20]))
    config = tmp_path / "motion.yaml"
    config.write_text("motion: {surge_std_m: 0.2}\nsmoothing: {passes: 1}\n")
    out = tmp_path / "elsewhere"
    assert main([str(folder), "--out", str(out), "--config", str(config)]) == 0
    output = capsys.readouterr().out
    assert "closures accepted" in output and "ATE" not in output and "wrong" not in output
    again = load_run(out)
    assert again.config == {"motion": {"surge_std_m": 0.2}, "smoothing": {"passes": 1}}
    known = np.isfinite(again.estimate).all(axis=1)
    assert known[:-20].all() and not known[-20:].any()
    # One older pass for each window.
    assert len(np.unique(again.closures.stamp)) == len(again.closures.stamp)


def test_closures_come_in_columns():
    closure = {
        "stamp": 9.0,
        "stamp_older": 0.0,
        "relative": [6.0, 2.0, -0.1],
        "covariance": np.diag([1.0, 2.0, 3.0]),
        "shift": [0.3, 0.2, 0.1],
        "rms_m": 0.1,
        "beams": 200,
        "weight": 0.5,
        "verdict": "accepted",
    }
    closures = smoothing._closures([closure])
    np.testing.assert_array_equal(closures.shift, [[0.3, 0.2, 0.1]])
    np.testing.assert_array_equal(closures.covariance, [[1, 0, 0, 2, 0, 3]])
    none = smoothing._closures([])
    assert none.relative.shape == (0, 3) and none.rows() == []


def test_a_survey_that_tells_nothing_stays_as_it_was(run):
    """Without a single beam there is no closure; the track is dead reckoning's."""
    dead_reckoning = run.dead_reckoning[:, smoothing.PLANAR]
    nothing = np.zeros(len(dead_reckoning), dtype=int)
    result = smoothing.smooth(
        run.stamp_s, dead_reckoning, np.empty((0, 3)), nothing, smoothing_params({})
    )
    assert len(result.closures.stamp) == 0
    np.testing.assert_allclose(result.poses[:, :2], dead_reckoning[:, :2], atol=1e-6)


def true_fixes(run, pings, covariance=(0.01, 0.0, 0.01)):
    where = run.ground_truth[pings][:, :2]
    return Fixes(run.stamp_s[pings], where, np.tile(covariance, (len(pings), 1)))


def test_fixes_of_the_run_turn_the_whole_of_it(run, folder):
    """Of which no overlap tells; one that is 50 m off is weighed down."""
    run = dataclasses.replace(run, config={**run.config, "start": {"yaw_std_rad": 0.05}})
    fixes = true_fixes(run, np.linspace(10, len(run.stamp_s) - 1, 12).astype(int))
    fixes.position[5] += 50.0
    params = smoothing_params(run.config)
    without, _ = smoothing.smooth_run(run, params)
    # The order in which they came is another one.
    shuffled = Fixes(**{name: value[::-1] for name, value in vars(fixes).items()})
    with_fixes, _ = smoothing.smooth_run(dataclasses.replace(run, fixes=shuffled), params)
    error_m = [ate_rmse(one.estimate, run.ground_truth) for one in (without, with_fixes)]
    assert error_m[1] < 0.5 * error_m[0]
    # By the command, through the folder: closer than without, and the fixes are kept.
    np.savez(folder / "fixes.npz", **{name: vars(fixes)[name] for name in Fixes.needed()})
    assert main([str(folder)]) == 0
    again = load_run(folder / "smoothed")
    assert len(again.fixes) == 12 and np.isfinite(again.estimate).all()
    assert ate_rmse(again.estimate, run.ground_truth) < error_m[0]


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"covariance": (1.0, 2.0, 1.0)}, r"fix 0 .* positive definite"),
        ({"position": (np.nan, 0.0)}, r"fix 0 lies at \[nan, 0.0\] m.* expected finite"),
        ({"stamp": 1e9}, r"fix 0 is of 1000000000.000 s, where dead_reckoning.tum has no pose"),
    ],
)
def test_fixes_that_cannot_be_used_are_named(run, changes, message):
    fixes = true_fixes(run, np.array([3]))
    for name, value in changes.items():
        getattr(fixes, name)[0] = value
    with pytest.raises(ValueError, match=f"fixes.npz: {message}"):
        smoothing.smooth_run(dataclasses.replace(run, fixes=fixes), smoothing_params({}))


def said(capsys):
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.count("\n") == 1
    return captured.err


@pytest.mark.parametrize("name", ["survey.npz", "dead_reckoning.tum", "trajectory.tum", "map.npz"])
def test_files_that_are_missing_or_damaged_are_named(folder, name, capsys):
    path = folder / name
    path.write_bytes(path.read_bytes()[:1000])
    assert main([str(folder)]) == 2
    assert re.match(rf"smooth_survey.py: error: .*{name}.*expected", said(capsys))
    path.unlink()
    assert main([str(folder)]) == 2
    assert re.match(rf"smooth_survey.py: error: .*{name}: no such file.*expected", said(capsys))
    assert not (folder / "smoothed").exists()


def test_bad_arguments_are_named(folder, tmp_path, capsys):
    assert main([str(tmp_path / "nowhere")]) == 2
    assert "nowhere: no such folder" in said(capsys)
    (folder / "dead_reckoning.tum").write_text("# nothing\n")
    assert main([str(folder)]) == 2
    assert "dead_reckoning.tum has poses at the stamps of 0 of" in said(capsys)


@pytest.mark.parametrize(
    "text, message",
    [
        (
            "motion: {surge_std: 0.1}",
            "motion/surge_std is unknown; did you mean motion/surge_std_m",
        ),
        ("smoothing: {passes: many}", "smoothing/passes is 'many'; expected an integer from 1"),
        ("- 3", "expected parameters by name"),
        ("{", "expected a yaml file"),
    ],
)
def test_an_overlay_that_is_wrong_is_named(folder, tmp_path, text, message, capsys):
    path = tmp_path / "wrong.yaml"
    path.write_text(text)
    assert main([str(folder), "--config", str(path)]) == 2
    assert message in said(capsys)


def test_no_run_is_overwritten(written, folder, tmp_path, capsys):
    other = Path(shutil.copytree(written, tmp_path / "other"))
    for out in (folder, other):
        before = contents(out)
        assert main([str(folder), "--out", str(out)]) == 2
        assert "has a run already, which is kept; expected another folder" in said(capsys)
        assert contents(out) == before
