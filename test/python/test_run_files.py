"""A run folder read back: nothing that a figure or a metric needs is lost."""

import dataclasses
import json
import shutil

import numpy as np
import pytest
from made_up_survey import make_run, write_run

from rbpf_svgp_slam.figures.report_figures import draw_figures
from rbpf_svgp_slam.metrics.evaluation import evaluate
from rbpf_svgp_slam.run.closures import Closures
from rbpf_svgp_slam.run.run_files import RunFolderError, load_run, save_run
from rbpf_svgp_slam.run.survey_run import StoredMap, TimeLapse
from rbpf_svgp_slam.svgp.config import SvgpConfig
from rbpf_svgp_slam.svgp.minibatch_svgp import MinibatchSvgp


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """A run with everything that a run can have, and its folder."""
    run = make_run()
    origin_m = np.array([50.0, 25.0])
    corners_m = np.array([[-60.0, -40.0], [60.0, -40.0], [60.0, 40.0], [-60.0, 40.0]])
    engine = MinibatchSvgp(SvgpConfig(inducing_points=25, optimizer="adam"), corners_m)
    for _ in range(20):
        engine.train_step((run.beams[::40] - [*origin_m, 0.0]).astype(np.float32), len(run.beams))
    frames = np.random.default_rng(0).random((3, 4, 5))
    lapse = TimeLapse(run.stamp_s[:3], np.arange(4.0), np.arange(5.0), frames)
    terrain = tmp_path_factory.mktemp("terrain") / "terrain.npz"
    grid = run.terrain
    origin = [grid.x[0], grid.y[0]]
    np.savez(terrain, z=grid.mean, resolution_m=grid.x[1] - grid.x[0], origin_m=origin)
    # One ping without ground truth, as at the end of a survey.
    truth = run.ground_truth.copy()
    truth[-1] = np.nan
    run = dataclasses.replace(
        run,
        ground_truth=truth,
        predict=lambda xy: engine.predict(xy - origin_m),
        noise_variance_m2=engine.noise_variance_m2,
        stored_map=StoredMap("svgp", engine.to_bytes(), origin_m),
        time_lapse=lapse,
        statistics={**run.statistics, "terrain": str(terrain)},
    )
    folder = tmp_path_factory.mktemp("saved") / "run"
    return run, folder, write_run(run, folder)


def test_a_run_read_back_is_the_run(saved):
    run, folder, _ = saved
    again = load_run(folder)
    # TUM files hold nine decimals.
    for name in ("estimate", "online", "dead_reckoning", "ground_truth"):
        np.testing.assert_allclose(getattr(again, name), getattr(run, name), atol=1e-8)
    arrays = "stamp_s held_out ping_of_beam estimate_covariance online_covariance support_points"
    for name in arrays.split():
        np.testing.assert_array_equal(getattr(again, name), getattr(run, name))
    for name, column in vars(run.closures).items():
        np.testing.assert_array_equal(getattr(again.closures, name), column)
    np.testing.assert_array_equal(again.levelled, run.levelled.astype(np.float32))
    for name in ("mean", "variance"):
        np.testing.assert_array_equal(getattr(again.map, name), getattr(run.map, name))
    xy = run.beams[:50, :2]
    np.testing.assert_array_equal(again.predict(xy), run.predict(xy))
    np.testing.assert_array_equal(again.terrain.mean, run.terrain.mean)
    np.testing.assert_array_equal(again.time_lapse.mean, run.time_lapse.mean)
    assert again.status_history.keys() == run.status_history.keys()
    assert again.config == run.config


def test_its_report_can_be_made_again(saved):
    _, folder, report = saved
    again = evaluate(load_run(folder)).report
    assert again.keys() == report.keys()
    for name, value in report.items():
        # Beams come back in float32, poses with nine decimals; the search for the seabed's model
        # may then end beside where it has ended before.
        if isinstance(value, float):
            rel = 1e-3 if name.startswith(("seabed", "depth", "tvu95")) else 1e-4
            assert again[name] == pytest.approx(value, rel=rel), name
        elif not isinstance(value, dict):
            assert again[name] == value, name


def test_a_folder_of_before_there_were_two_estimates_is_scored(saved, tmp_path):
    _, folder, report = saved
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    for name in ("online.tum", "closures.npz", "report.json"):
        (tmp_path / name).unlink()
    with np.load(folder / "survey.npz") as file:
        arrays = {name: file[name] for name in file.files if not name.endswith("covariance")}
    # As it was then.
    np.savez(tmp_path / "survey.npz", **arrays, estimate_std_m=np.ones((len(arrays["stamp_s"]), 2)))
    old = load_run(tmp_path)
    scored = evaluate(old).report
    assert scored["ate_rmse_m"] == pytest.approx(report["ate_rmse_m"], rel=1e-6)
    new = {n for n in report if n.startswith(("online", "nees", "closure"))}
    assert len(new) == 13
    assert {scored[name] for name in new} == {None}
    assert "loop_closures" not in {name for name, *_ in draw_figures(old, evaluate(old))}


def test_what_an_earlier_run_has_left_does_not_stay(saved, tmp_path):
    run, folder, _ = saved
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    save_run(dataclasses.replace(run, online=None, closures=None, online_covariance=None), tmp_path)
    again = load_run(tmp_path)
    assert again.online is None and again.closures is None and again.online_covariance is None


def test_closures_of_a_wrong_shape_are_named(saved, tmp_path):
    run, folder, _ = saved
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    np.savez(tmp_path / "closures.npz", **{**vars(run.closures), "shift": np.zeros((2, 3))})
    with pytest.raises(ValueError, match="closures' shift: expected shape"):
        load_run(tmp_path)


def test_a_run_that_has_tried_no_closure_says_so(saved, tmp_path):
    run, _, _ = saved
    save_run(dataclasses.replace(run, closures=Closures.of([])), tmp_path)
    report = evaluate(load_run(tmp_path)).report
    assert (report["closures"], report["closures_accepted"], report["closures_refused"]) == (
        [],
        0,
        {},
    )
    assert report["closures_wrong"] == 0 and report["closures_wrong_share"] is None


def test_a_run_of_another_program_is_scored_by_its_grid(saved, tmp_path):
    _, folder, report = saved
    for name in ("survey.npz", "trajectory.tum", "dead_reckoning.tum", "ground_truth.tum"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    with np.load(folder / "map.npz") as ours:
        np.savez(
            tmp_path / "map.npz", **{name: ours[name] for name in ("x", "y", "mean", "variance")}
        )
    scored = evaluate(load_run(tmp_path)).report
    assert scored["ate_rmse_m"] == pytest.approx(report["ate_rmse_m"], rel=1e-6)
    # make_run's grid is of another map than the engine that the folder holds: an error of 0.035 m
    # and noise of 0.1 m, and what bilinear interpolation at 1 m adds on ripples of 0.7 m.
    assert scored["map_rmse_m"] == pytest.approx(0.12, abs=0.03)
    assert scored["particles"] is None


@pytest.mark.parametrize("name", ["survey.npz", "trajectory.tum", "dead_reckoning.tum", "map.npz"])
def test_what_is_missing_or_damaged_is_named(saved, tmp_path, name):
    _, folder, _ = saved
    for path in folder.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    (tmp_path / name).unlink()
    with pytest.raises(RunFolderError, match=f"{name}: no such file"):
        load_run(tmp_path)
    (tmp_path / name).write_bytes(b"PK\x03\x04 cut short")
    with pytest.raises(ValueError, match=name):
        load_run(tmp_path)


def test_a_report_that_is_no_json_is_named(saved, tmp_path):
    _, folder, _ = saved
    for path in folder.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    (tmp_path / "report.json").write_text(json.dumps({"particles": 3})[:-2])
    with pytest.raises(RunFolderError, match="report.json"):
        load_run(tmp_path)
