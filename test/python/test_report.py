"""report.json and report.html of a made-up survey with known errors."""

import json
import re

import numpy as np
import pytest
from browser import CHROMIUM, look
from made_up_survey import NOISE_M, OF_PINGS, ORIGIN_DEG, without, write_run

from rbpf_svgp_slam.evaluation.numbers import format_duration
from rbpf_svgp_slam.evaluation.result_lines import summarise
from rbpf_svgp_slam.evaluation.survey_facts import survey_facts
from rbpf_svgp_slam.metrics.survey_metrics import survey_metrics
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
    "area_m2 track_length_m depth_min_m depth_median_m depth_max_m beams_per_m2 tvu95_m "
    "s44_order_shares "
    "seabed_rmse_m seabed_msll seabed_coverage seabed_interval95_coverage seabed_spacing_m "
    "consistency_rmse_m grid_rmse_m peak_rss_mb"
).split()


@pytest.fixture(scope="module")
def folder(run, tmp_path_factory):
    out_dir = tmp_path_factory.mktemp("survey") / "run"
    return out_dir, write_run(run, out_dir, figures=True)


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
    figures = re.findall(
        r'<figure id="(\w+)">\s*<a [^>]*>\s*<img [^>]*src="data:image/png;base64,iVBOR', text
    )
    assert figures == [
        "depth_chart",
        "survey_quality",
        "trajectories",
        "position_errors",
        "loop_closures",
        "raw_bathymetry",
        "posterior",
        "seabed_maps",
        "consistency_maps",
        "held_out_residuals",
        "elbo",
        "filter_history",
    ]
    assert "svgp/kernel" in text and "matern12" in text
    assert "<dt>refused</dt><dd>pings/no_beams 3</dd>" in text
    # No address: base64 has no colon.
    assert "://" not in text and "<script" not in text and "url(" not in text


def test_without_figures_everything_else_is_there(run, folder, tmp_path):
    (tmp_path / "time_lapse.gif").write_bytes(b"an earlier run's")
    report = write_run(run, tmp_path, figures=False)
    assert report == folder[1]
    assert not (tmp_path / "time_lapse.gif").exists()
    text = (tmp_path / "report.html").read_text()
    assert "<img" not in text and "evaluate_run.py --rewrite" in text
    assert "<th" in text and "svgp/kernel" in text
    assert "evaluate_run.py --rewrite" not in (folder[0] / "report.html").read_text()


needs_chromium = pytest.mark.skipif(
    CHROMIUM is None, reason="no chromium to look at the page with: tools/setup.sh installs it"
)
DESKTOP_PX, PHONE_PX = 1280, 390


@needs_chromium
def test_a_reader_sees_every_figure_at_the_desk_and_on_a_phone(folder, tmp_path):
    text = (folder[0] / "report.html").read_text()
    seen, console = look(text, tmp_path, (DESKTOP_PX, PHONE_PX))
    assert [one.width_px for one in seen] == [DESKTOP_PX, PHONE_PX]
    for one in seen:
        assert one.complaints() == []
        assert len(one.images) == 12
        # A figure fills its column, but for margins.
        assert all(shown > 0.65 * min(one.width_px, 1000) for _, shown, _ in one.images)
    assert console == []


@needs_chromium
def test_what_a_reader_would_miss_is_found(tmp_path):
    broken = """<!DOCTYPE html><body><img alt="gone" src="data:image/png;base64,AAAA">
    <div style="width: 500px">wide</div><script>console.error("oh")</script></body>"""
    [desktop, phone], console = look(broken, tmp_path, (DESKTOP_PX, PHONE_PX))
    assert desktop.complaints()[0] == "no image: gone"
    assert any(text.startswith("page of 5") for text in phone.complaints())
    assert not any(text.startswith("page of") for text in desktop.complaints())
    assert any("oh" in line for line in console)


def test_the_report_begins_with_what_a_hydrographer_asks(run, folder):
    report = folder[1]
    # Six lines of 100 m, and five half circles of 5 m radius; the estimate sways by half a metre.
    assert report["track_length_m"] == pytest.approx(6 * 100 + 5 * np.pi * 5, rel=0.02)
    # What the lines and turns sweep, 12 m to either side: no less than its rectangle without
    # corners, no more than the map.
    assert 100 * 74 < report["area_m2"] < run.map.mean.size
    # 0.75 m between pings, 24 m / 39 between beams, and lines 10 m apart: swaths overlap twice.
    assert 2 <= report["beams_per_m2"] <= 6
    # Ripples of 0.7 m at 25 m, and a mound of 4 m; five σ of a beam's noise are allowed.
    assert report["depth_max_m"] == pytest.approx(25.7, abs=5 * NOISE_M)
    assert 20.3 - 5 * NOISE_M < report["depth_min_m"] < 21.5
    assert report["depth_min_m"] < report["depth_median_m"] < report["depth_max_m"]
    assert report["tvu95_m"] > 1.96 * NOISE_M
    shown = {
        tvu95_m: survey_facts({**report, "tvu95_m": tvu95_m})[
            "total vertical uncertainty (95 %), median"
        ]
        for tvu95_m in (None, 0.0043, 0.43)
    }
    assert list(shown.values()) == ["– m", "0.004 m", "0.43 m"]
    assert [format_duration(t_s) for t_s in (None, 5.9, 150.0, 9000.0)] == [
        "–",
        "5.9 s",
        "2.5 min",
        "2.5 h",
    ]
    assert sum(report["s44_order_shares"].values()) == pytest.approx(1)
    assert report["crs"] is None and report["map_turned_by_deg"] is None
    text = (folder[0] / "report.html").read_text()
    assert "local frame, without survey_origin" in text and "EPSG:" not in text
    assert text.index("area surveyed") < text.index("Order of S-44") < text.index("position error")


def test_a_survey_with_a_place_names_its_crs_and_datum(run):
    notes = []
    # Of few beams no seabed is made: the best particle's map is what is charted.
    few = {"levelled": run.levelled[:3000], "ping_of_beam": run.ping_of_beam[:3000]}
    placed = without(run, **few, config={**run.config, "survey_origin": ORIGIN_DEG})
    metrics = survey_metrics(placed, notes)
    assert metrics["crs"] == {"epsg": 32632, "name": "WGS 84 / UTM zone 32N"}
    assert metrics["vertical_crs"]["epsg"] == 5714
    # tan γ = tan(λ − λ₀) sin φ, with the zone's central meridian λ₀ at 9°: east of it, grid
    # north lies east of true north, so that a direction turns anticlockwise by γ.
    convergence = np.arctan(np.tan(np.deg2rad(11.2 - 9)) * np.sin(np.deg2rad(57.5)))
    assert metrics["map_turned_by_deg"] == pytest.approx(np.rad2deg(convergence), abs=1e-3)
    facts = survey_facts({**metrics, "beams": 1})
    assert facts["horizontal CRS"] == "EPSG:32632, WGS 84 / UTM zone 32N"
    assert "MSL height" in facts["vertical datum"] and not notes
    # 75 pings 0.75 m apart, and a swath of 24 m.
    assert metrics["area_m2"] == pytest.approx(75 * 0.75 * 24, rel=0.1)
    wrong = without(placed, config={**placed.config, "survey_epsg": 4326})
    assert survey_metrics(wrong, notes)["crs"] is None
    assert "EPSG:4326" in notes[0]


def test_the_last_lines_tell_both_estimates_and_the_closures(folder):
    out_dir, report = folder
    lines = summarise(report, out_dir).splitlines()
    online, final, dr = (
        f"{report[name]:.2f} m" for name in ("online_ate_rmse_m", "ate_rmse_m", "dr_ate_rmse_m")
    )
    assert lines[0] == f"RBPF error: online ATE {online}, final ATE {final} (DR {dr})"
    ideal = [f"{report[f'ideal_{name}ate_rmse_m']:.2f} m" for name in ("online_", "")]
    assert lines[2] == f"Ideal:      online ATE {ideal[0]}, final ATE {ideal[1]}"
    seabed, grid = (report[f"{name}_m"] for name in ("seabed_rmse_on_grid_beams", "grid_rmse"))
    off = f"{seabed:.3f} m off at held-out beams (1 m grid {grid:.3f} m)"
    assert lines[3] == f"Seabed:     {off}"
    assert lines[4] == "Closures:   13 accepted, 2 wrong; 3 refused"
    assert lines[5].endswith("report.html") and len(lines) == 6
    new = ("online", "closure", "ideal", "seabed")
    old = {name: value for name, value in report.items() if not name.startswith(new)}
    lines = summarise(old, out_dir).splitlines()
    assert lines[0] == f"RBPF error: online ATE unknown, final ATE {final} (DR {dr})"
    assert len(lines) == 3


def test_without_ground_truth_errors_are_null(run, folder, tmp_path):
    blind = without(run, ground_truth=None, terrain=None)
    (tmp_path / "ground_truth.tum").write_text("of an earlier run")
    report = write_run(blind, tmp_path, figures=True)
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
    assert (tmp_path / "report.html").read_text().count("<figure id=") == 12
    page = (tmp_path / "report.html").read_text()
    assert "Without ground truth the errors of the trajectory" in page
    assert "position error, RMS" not in page and "consistency of passes" in page
    lines = summarise(report, tmp_path).splitlines()
    assert lines[0] == "RBPF error: unknown, for there is no ground truth"
    assert [line.split(":")[0] for line in lines[1:]] == ["Seabed", "Closures", "Report"]


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
    report = write_run(empty, tmp_path, figures=True)
    assert report["beams"] == 0 and report["map_rmse_m"] is None
    assert report["consistency_rmse_m"] is None and report["particles"] is None
    assert any("not recorded" in note for note in report["notes"])
    assert report["seabed_rmse_m"] is None and report["area_m2"] is None
    why = "no seabed of the final trajectory: 0 beams to make it from; expected at least 4000"
    assert any(note.startswith(why) for note in report["notes"])
    assert not (tmp_path / "seabed.npz").exists()
