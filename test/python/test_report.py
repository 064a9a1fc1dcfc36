"""report.json and report.html of a made-up survey with known errors."""

import json
import re

import numpy as np
import pytest
from made_up_survey import OF_PINGS, without, write_run

from rbpf_svgp_slam.evaluation.result_lines import summarise
from rbpf_svgp_slam.run.tracks import read_tum

CONTRACT = (
    "particles nodes seed pings pings_dropped beams duration_s wall_s real_time_factor "
    "iterations_total iterations_per_particle iterations_per_s loop_closure_prompts resamplings "
    "ate_rmse_m dr_ate_rmse_m ate_aligned_rmse_m dr_ate_aligned_rmse_m final_error_m "
    "dr_final_error_m rpe_rmse_m dr_rpe_rmse_m rpe_delta_s "
    "online_ate_rmse_m online_ate_aligned_rmse_m nees nees_skipped online_nees online_nees_skipped "
    "closures closures_accepted closures_refused closures_wrong closures_wrong_share "
    "closure_error_median_m closure_nees "
    "map_rmse_m map_msll "
    "seabed_rmse_m seabed_msll seabed_coverage seabed_interval95_coverage seabed_spacing_m "
    "consistency_rmse_m grid_rmse_m peak_rss_mb"
).split()


@pytest.fixture(scope="module")
def folder(run, tmp_path_factory):
    out_dir = tmp_path_factory.mktemp("survey") / "run"
    return out_dir, write_run(run, out_dir)


def test_report_json_holds_the_contract_and_no_nan(folder):
    out_dir, report = folder

    def refuse(word):
        raise AssertionError(f"{word} in report.json")

    read = json.loads((out_dir / "report.json").read_text(), parse_constant=refuse)
    assert read == report
    assert [name for name in CONTRACT if report.get(name) is None] == []
    assert report["notes"] == []


def test_report_recovers_the_known_errors(run, folder):
    report = folder[1]
    truth, drift = run.ground_truth, run.dead_reckoning - run.ground_truth
    assert report["dr_ate_rmse_m"] == pytest.approx(np.sqrt(np.mean((drift**2).sum(axis=1))))
    assert report["final_error_m"] == pytest.approx(
        np.linalg.norm(run.estimate[-1, :3] - truth[-1, :3])
    )
    assert report["real_time_factor"] == pytest.approx(report["duration_s"] / 150)
    assert report["iterations_per_particle"] == 900
    for name in ("consistency_rmse_m", "overlap_consistency_rmse_m"):
        assert report[f"ground_truth_{name}"] < report[name] < report[f"dr_{name}"]
    # The map errs by 0.05·sin(x), RMS 0.0354 m, the beams by 0.1 m: 0.1061 m together. With 3,200
    # held-out beams its standard error is 0.1061/√6400 = 0.0013 m; four are allowed.
    assert report["map_rmse_at_ground_truth_m"] == pytest.approx(0.1061, abs=0.0053)
    # The mean of sin² over whole metres, not over x, is within 0.05 of a half.
    assert report["terrain_rmse_m"] == pytest.approx(0.05 / np.sqrt(2), rel=0.05)
    assert report["map_msll"] < -0.5


def test_run_folder_is_complete(run, folder):
    out_dir, _ = folder
    names = {path.name for path in out_dir.iterdir()}
    tracks = {"trajectory.tum", "online.tum", "dead_reckoning.tum", "ground_truth.tum"}
    data = {"map.npz", "survey.npz", "closures.npz", "history.npz", "parameters.yaml"}
    assert names == tracks | data | {"report.json", "report.html", "seabed.npz"}
    with np.load(out_dir / "map.npz") as saved:
        for name in ("x", "y", "mean", "variance"):
            np.testing.assert_array_equal(saved[name], getattr(run.map, name))
    stamp_s, poses = read_tum(out_dir / "trajectory.tum")
    np.testing.assert_allclose(stamp_s, run.stamp_s)
    # Nine decimals of metres and of a unit quaternion.
    np.testing.assert_allclose(poses[:, :5], run.estimate[:, :5], atol=1e-8)


def test_html_holds_every_figure_and_parameter_and_needs_no_network(folder):
    text = (folder[0] / "report.html").read_text()
    figures = re.findall(r'<figure id="(\w+)">\s*<img [^>]*src="data:image/png;base64,iVBOR', text)
    assert figures == [
        "trajectories",
        "position_errors",
        "loop_closures",
        "raw_bathymetry",
        "seabed",
        "posterior",
        "seabed_maps",
        "consistency_maps",
        "held_out_residuals",
        "elbo",
        "filter_history",
    ]
    assert "svgp/kernel" in text and "matern12" in text
    # No address: base64 has no colon.
    assert "://" not in text and "<script" not in text and "url(" not in text


def test_the_last_lines_tell_both_estimates_and_the_closures(folder):
    out_dir, report = folder
    lines = summarise(report, out_dir).splitlines()
    online, final, dr = (
        f"{report[name]:.2f} m" for name in ("online_ate_rmse_m", "ate_rmse_m", "dr_ate_rmse_m")
    )
    assert lines[0] == f"RBPF error: online ATE {online}, final ATE {final} (DR {dr})"
    ideal = [f"{report[f'ideal_{name}ate_rmse_m']:.2f} m" for name in ("online_", "")]
    assert lines[2] == f"Ideal:      online ATE {ideal[0]}, final ATE {ideal[1]}"
    assert lines[3] == "Closures:   13 accepted, 2 wrong; 3 refused"
    assert lines[4].endswith("report.html") and len(lines) == 5
    new = ("online", "closure", "ideal")
    old = {name: value for name, value in report.items() if not name.startswith(new)}
    lines = summarise(old, out_dir).splitlines()
    assert lines[0] == f"RBPF error: online ATE unknown, final ATE {final} (DR {dr})"
    assert len(lines) == 3


def test_without_ground_truth_errors_are_null(run, folder, tmp_path):
    blind = without(run, ground_truth=None, terrain=None)
    (tmp_path / "ground_truth.tum").write_text("of an earlier run")
    report = write_run(blind, tmp_path)
    for name in "online_ate_rmse_m nees nees_skipped closures_wrong closure_nees".split():
        assert report[name] is None
    assert report["closures_accepted"] == 13
    assert report["ideal_ate_rmse_m"] is None
    errors = "ate_rmse_m final_error_m rpe_rmse_m".split()
    for name in [*errors, *(f"dr_{name}" for name in errors)]:
        assert report[name] is None
    assert report["map_rmse_m"] == folder[1]["map_rmse_m"]
    assert any("no ground truth" in note for note in report["notes"])
    assert not (tmp_path / "ground_truth.tum").exists()
    assert (tmp_path / "report.html").read_text().count("<figure id=") == 11


@pytest.mark.parametrize("pings", [0, 1])
def test_a_survey_without_beams_is_reported(run, tmp_path, pings):
    none = np.empty((0, 3), dtype=np.float32)
    few = {name: getattr(run, name)[:pings] for name in OF_PINGS}
    empty = without(
        run,
        **few,
        levelled=none,
        ping_of_beam=np.empty(0, dtype=int),
        statistics={},
        status_history={},
        config={},
    )
    report = write_run(empty, tmp_path)
    assert report["beams"] == 0 and report["map_rmse_m"] is None
    assert report["consistency_rmse_m"] is None and report["particles"] is None
    assert any("not recorded" in note for note in report["notes"])
    assert report["seabed_rmse_m"] is None
    why = "no seabed of the final trajectory: 0 beams to make it from; expected at least 4000"
    assert any(note.startswith(why) for note in report["notes"])
    assert not (tmp_path / "seabed.npz").exists()
