"""export_map.py and the export after a run: choices, bad input, and failures that cost nothing."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from made_up_survey import ORIGIN_DEG

from rbpf_svgp_slam.evaluation import smooth_survey
from rbpf_svgp_slam.exports import export_run
from rbpf_svgp_slam.exports.after_run import export_after_run
from rbpf_svgp_slam.exports.export_map import main

SCRIPT = Path(__file__).parents[2] / "scripts" / "export_map.py"
QUICK = ["--formats", "geotiff", "sbet"]


@pytest.fixture
def folder(placed_folder, tmp_path):
    return Path(shutil.copytree(placed_folder, tmp_path / "run"))


def config_of(folder):
    return yaml.safe_load((folder / "parameters.yaml").read_text())


def set_parameters(folder, **changes):
    config = {**config_of(folder), **changes}
    (folder / "parameters.yaml").write_text(yaml.safe_dump(config))
    return config


def names(folder):
    return {path.name for path in folder.iterdir()}


def summary_of(out):
    return json.loads((out / "summary.json").read_text())


def test_the_script_writes_what_is_asked_for(folder):
    done = subprocess.run(
        [sys.executable, SCRIPT, folder, *QUICK], capture_output=True, text=True, check=True
    )
    expected = {"seabed.tif", "trajectory.sbet", "summary.json", "summary.md"}
    assert names(folder / "export") == expected
    assert done.stdout == f"{folder}/export: {', '.join(sorted(expected))}\n"


def test_options_count_more_than_parameters(folder, tmp_path):
    set_parameters(folder, survey_epsg=25832)
    assert main([str(folder), *QUICK]) == 0
    assert summary_of(folder / "export")["crs"]["name"] == "ETRS89 / UTM zone 32N"
    out = tmp_path / "deep" / "out"
    options = ["--origin", "-33.9", "18.4", "--epsg", "32734", "--vertical-epsg", "3855"]
    options += ["--contour-interval", "0.25", "--out", str(out)]
    assert main([str(folder), *QUICK, *options]) == 0
    summary = summary_of(out)
    assert summary["survey_origin"] == pytest.approx([-33.9, 18.4])
    assert summary["crs"]["epsg"] == 32734 and summary["vertical_crs"]["epsg"] == 3855
    assert summary["contour_interval_m"] == 0.25


def test_an_earlier_export_is_replaced_and_other_files_are_kept(folder):
    out = folder / "export"
    assert main([str(folder), "--formats", "xyz", "csv"]) == 0
    (out / "notes.txt").write_text("mine")
    assert main([str(folder), "--formats", "tum"]) == 0
    assert names(out) == {"notes.txt", "trajectory.tum", "summary.json", "summary.md"}
    assert not list(folder.glob(".export_*"))


def test_a_run_of_another_program_is_exported(folder):
    for name in ("parameters.yaml", "seabed.npz", "history.npz", "closures.npz"):
        (folder / name).unlink()
    with np.load(folder / "survey.npz") as file:
        needed = {k: file[k] for k in ("stamp_s", "held_out", "beams_per_ping", "levelled")}
    np.savez(folder / "survey.npz", **needed)
    assert main([str(folder), "--origin", "57.5", "11.2"]) == 0
    summary = summary_of(folder / "export")
    assert summary["seabed"] == "map.npz" and summary["position_std_m"]["p95"] == 0
    assert any("no covariances" in note for note in summary["notes"])
    header = (folder / "export" / "trajectory.csv").read_text().splitlines()[0]
    assert header.endswith("heading_deg")


def test_lengths_and_places_that_a_crs_is_not_made_for_are_told(folder, capsys):
    assert main([str(folder), *QUICK]) == 0 and not capsys.readouterr().err
    assert main([str(folder), *QUICK, "--epsg", "3857"]) == 0
    assert any("A metre on the ground is 1.8" in n for n in summary_of(folder / "export")["notes"])
    assert main([str(folder), *QUICK, "--epsg", "32633"]) == 0
    assert any("not where" in note for note in summary_of(folder / "export")["notes"])
    told = capsys.readouterr().err.splitlines()
    assert all(line.startswith("export_map.py: warning: ") for line in told)
    assert "A metre on the ground" in told[0] and "is not where" in told[-1]


def said(capsys):
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.count("\n") == 1
    return captured.err


@pytest.mark.parametrize(
    "options, message",
    [
        (["--epsg", "4326"], "EPSG:4326 is WGS 84; expected a projected CRS in metres"),
        (["--epsg", "999999"], "EPSG:999999 is unknown to PROJ; expected"),
        (["--epsg", "-5"], "--epsg is -5; expected an integer in 0 .. 999999"),
        (["--vertical-epsg", "5715"], "EPSG:5715 is MSL depth; expected"),
        (["--origin", "97", "11"], "--origin is [97.0, 11.0]; expected [latitude, longitude]"),
        (["--origin", "nan", "11"], "--origin is [nan, 11.0]; expected [latitude, longitude]"),
        (["--formats", "shapefile"], "--formats is 'shapefile'; expected some of geotiff, bag"),
        (["--contour-interval", "0"], "--contour-interval is 0.0; expected a number above 0"),
        (["--out", str(SCRIPT)], "export_map.py is no folder; expected one to write into"),
    ],
)
def test_options_that_are_wrong_are_named(folder, options, message, capsys):
    before = names(folder)
    assert main([str(folder), *options]) == 1
    error = said(capsys)
    assert error.startswith("export_map.py: error: ") and message in error
    assert names(folder) == before


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"survey_origin": []}, "has no origin; expected .* --origin LAT LON, or the parameter"),
        ({"survey_origin": "here"}, "survey_origin is 'here'; expected .latitude, longitude."),
        ({"survey_epsg": 4326}, "EPSG:4326 is WGS 84; expected"),
        ({"survey_epsg": "UTM"}, "parameters.yaml: survey_epsg is 'UTM'; expected an integer"),
    ],
)
def test_parameters_that_are_wrong_are_named(folder, changes, message, capsys):
    set_parameters(folder, **changes)
    assert main([str(folder)]) == 1
    assert re.search(message, said(capsys))


@pytest.mark.parametrize("name", ["survey.npz", "trajectory.tum", "seabed.npz", "parameters.yaml"])
def test_files_that_are_damaged_or_missing_are_named(folder, name, capsys):
    path = folder / name
    path.write_bytes(b"\x93{" + path.read_bytes()[:1000])
    before = names(folder)
    assert main([str(folder)]) == 1
    assert name in said(capsys)
    if name not in ("seabed.npz", "parameters.yaml"):
        path.unlink()
        assert main([str(folder)]) == 1
        error = said(capsys)
        assert f"{name}: no such file; expected" in error
    assert names(folder) <= before


def test_a_folder_that_is_no_run_is_named(tmp_path, capsys):
    assert main([str(tmp_path / "nowhere")]) == 1
    assert "nowhere: no such folder; expected a run folder" in said(capsys)
    assert main([str(tmp_path)]) == 1
    assert "survey.npz: no such file; expected arrays" in said(capsys)


@pytest.mark.parametrize(
    "change, message",
    [
        (lambda f: {"std": f["std"][1:]}, "seabed.npz: variance: expected shape"),
        (lambda f: {"x": f["x"][::-1]}, "seabed.npz: expected at least two even steps along x"),
        (lambda f: {"mean": np.full_like(f["mean"], np.nan)}, "mean has no finite value"),
    ],
)
def test_a_seabed_that_is_none_is_named(folder, change, message, capsys):
    with np.load(folder / "seabed.npz") as file:
        arrays = {**file}
    np.savez(folder / "seabed.npz", **{**arrays, **change(arrays)})
    assert main([str(folder)]) == 1
    assert message in said(capsys)


def test_what_fails_on_the_way_leaves_the_earlier_export(folder, monkeypatch, capsys):
    assert main([str(folder), *QUICK]) == 0
    before = {p.name: p.read_bytes() for p in (folder / "export").iterdir()}
    monkeypatch.setitem(export_run.WRITERS, "sbet", fail)
    capsys.readouterr()
    assert main([str(folder), *QUICK]) == 1
    assert "No space left" in said(capsys)
    assert {p.name: p.read_bytes() for p in (folder / "export").iterdir()} == before
    assert not list(folder.glob(".export_*"))


def fail(_, path):
    path.write_bytes(b"half")
    raise OSError("No space left on device")


# After a run


def test_after_a_run_with_an_origin_all_is_exported(folder):
    complaints = []
    files = export_after_run(folder, config_of(folder), complaints.append)
    assert {path.name for path in files} == names(folder / "export") and not complaints


def test_after_a_run_without_an_origin_an_earlier_export_does_not_stay(folder):
    assert main([str(folder), *QUICK]) == 0
    assert export_after_run(folder, {"survey_origin": []}, pytest.fail) == []
    assert not (folder / "export").exists()


def test_after_a_run_a_format_that_fails_costs_no_other(folder, monkeypatch):
    complaints = []
    monkeypatch.setitem(export_run.WRITERS, "bag", fail)
    export_after_run(folder, config_of(folder), complaints.append)
    (complaint,) = complaints
    assert complaint.startswith(f"No bag in {folder}/export: No space left on device. To try again")
    assert "seabed.bag" not in names(folder / "export") and "seabed.nc" in names(folder / "export")


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"survey_epsg": 4326}, "EPSG:4326 is WGS 84"),
        ({"survey_origin": [1, 2, 3]}, "survey_origin is [1, 2, 3]"),
    ],
)
def test_after_a_run_an_origin_that_is_wrong_is_told(folder, changes, message):
    complaints = []
    before = names(folder)
    assert export_after_run(folder, {**config_of(folder), **changes}, complaints.append) == []
    (complaint,) = complaints
    assert complaint.startswith("No export in ") and message in complaint
    assert names(folder) == before


def test_an_adjusted_survey_has_its_own_export(folder, capsys):
    assert smooth_survey.main([str(folder)]) == 0
    smoothed = folder / "smoothed"
    assert {"seabed.tif", "trajectory.sbet"} < names(smoothed / "export")
    assert json.loads((smoothed / "report.json").read_text())["survey_origin"] == ORIGIN_DEG
    assert not (folder / "export").exists() and capsys.readouterr().err == ""


def test_the_script_can_be_started():
    assert os.access(SCRIPT, os.X_OK)
