"""The bench of smoothing, scaled down: its surveys, seabeds and table."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from bench.smoothing import closures, defaults, seabeds, simulated_runs
from rbpf_svgp_slam.simulation.mission import get_mission

SCALE = 0.1  # of lolo3: some three minutes of survey


@pytest.fixture(scope="module")
def survey():
    return simulated_runs.simulated_run("rippled dunes", 1, SCALE)


def test_beams_lie_on_the_seabed_and_outliers_are_gone(survey):
    mission = get_mission(simulated_runs.MISSION, SCALE)
    terrain = seabeds.rippled_dunes(mission, 1)
    x, y, z = survey.beams_ground_truth.T
    off_m = np.abs(z - terrain.height_m(x, y))
    # A beam at 60 degrees and 28 m of range errs by 0.1 m; false ones are metres off.
    assert np.nanmedian(off_m) < 0.1
    assert np.nanmean(off_m > 1.0) < 1e-3
    assert 0.95 < len(survey.levelled) / (len(survey.stamp_s) * mission.beams) < 0.995


def test_seabeds_are_as_high_as_they_say(monkeypatch):
    mission = get_mission(simulated_runs.MISSION, SCALE)
    flat = seabeds.nearly_flat(mission, 3).z_m
    assert np.subtract(*np.percentile(flat, [95, 5])) == pytest.approx(0.11, abs=0.02)
    rippled = seabeds.rippled_dunes(mission, 3).z_m
    assert not np.array_equal(rippled, seabeds.rippled_dunes(mission, 4).z_m)
    monkeypatch.setattr(seabeds, "AMPLITUDE_M", 0.0)
    ripples = rippled - seabeds.rippled_dunes(mission, 3).z_m
    assert ripples.std() == pytest.approx(0.25 / np.sqrt(2), rel=0.02)
    assert np.abs(ripples).max() == pytest.approx(0.25, abs=1e-3)


def test_boulders_stand_on_the_flat_and_a_slope_rises():
    mission = get_mission(simulated_runs.MISSION, SCALE)
    flat = seabeds.nearly_flat(mission, 3)
    boulders_m = seabeds.boulder_field(mission, 3).z_m - flat.z_m
    # Domes of 0.5 to 2 m radius, one on 150 m2: pi * mean(r^2) / 150 of the seabed, as far as they
    # do not overlap.
    radii_m = np.array(seabeds.BOULDER_RADII_M)
    mean_square_m2 = (radii_m[1] ** 3 - radii_m[0] ** 3) / 3 / np.ptp(radii_m)
    assert (boulders_m > 0).mean() == pytest.approx(np.pi * mean_square_m2 / 150, rel=0.15)
    assert boulders_m.min() > -0.15 and 0.8 < boulders_m.max() < 1.15
    rise_m = seabeds.slope(mission, 3).z_m - flat.z_m
    gradient = np.hypot(*np.gradient(rise_m, flat.resolution_m))
    np.testing.assert_allclose(gradient, seabeds.SLOPE, rtol=1e-3)


def test_the_bench_writes_its_tables_and_goes_on_where_it_was(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("CLOSURE_SEEDS", "1")
    monkeypatch.setenv("CLOSURE_SCALE", str(SCALE))
    monkeypatch.setattr(
        simulated_runs, "SEABEDS", {"nearly flat": seabeds.nearly_flat, "block_b": None}
    )
    monkeypatch.setattr(simulated_runs, "REAL_SEABED", tmp_path / "none.npz")
    figures = closures.run(tmp_path)["closures"]
    json.dumps(figures, allow_nan=False)
    assert set(figures) == {"nearly flat"} and "left out" in capsys.readouterr().out
    row = figures["nearly flat"]
    assert row["surveys"] == 1 and row["ideal_ate_m"] <= row["dr_ate_m"] * 1.1
    text = (tmp_path / "closures.md").read_text()
    assert text.count("| nearly flat |") == 2
    monkeypatch.setattr(simulated_runs, "simulated_run", None)  # no survey is made again
    assert closures.run(tmp_path)["closures"] == figures


def test_medians_and_the_worst():
    counts = dict.fromkeys(closures.VERDICTS, 1)
    rows = [
        {"dr_ate_m": 4.0, "ate_m": ate, "ideal_ate_m": 0.5, "accepted": 50, "wrong": 1, **counts}
        for ate in (0.5, 1.0, 4.4)
    ]
    summary = closures.summary(rows)
    assert (summary["ate_m"], summary["over_ideal"]) == (1.0, 2.0)
    assert summary["over_dr_worst"] == pytest.approx(1.1)
    assert summary["wrong_percent"] == pytest.approx(2.0)


def test_what_a_changed_parameter_is_worth(tmp_path, monkeypatch):
    surveys = iter([{"ate_m": 1.0}, {"ate_m": 4.0}])  # of the two seeds, with the defaults

    def score(survey, change):
        factor = {0.0: 2.0, 0.01: 0.5}.get(change.get("current_std_mps"), 1.0)
        of_all = {"dr_ate_m": 5.0, "aligned_m": 1.0, "nees": survey["ate_m"], "wrong": None}
        return {**of_all, "ate_m": factor * survey["ate_m"], "cpu_s": 1.0}

    monkeypatch.setattr(defaults, "CASES", ["base"])
    monkeypatch.setattr(defaults, "as_run", lambda _: next(surveys))
    monkeypatch.setattr(defaults, "score", score)
    monkeypatch.setattr(defaults, "cases", lambda _: [SimpleNamespace(survey=lambda _: None)])
    monkeypatch.setenv("DEFAULT_SEEDS", "2")
    monkeypatch.setenv("DEFAULT_PARAMETERS", "current_std_mps")
    rows = defaults.run(tmp_path)["defaults"]
    assert set(rows) == {"defaults"} | {f"current_std_mps: {v}" for v in ("0", "0.0015", "0.01")}
    usual, without = rows["defaults"], rows["current_std_mps: 0"]
    assert (usual["final, base"], usual["final"], usual["worst final over DR"]) == (2.5, 1.0, 0.8)
    assert (without["final, base"], without["final"]) == (2.0, pytest.approx(2.0))
    assert without["worst final over DR"] == pytest.approx(1.6)
    assert (usual["NEES"], usual["NEES above 2"], usual["wrong"]) == (2.5, 1, 0)
    assert (tmp_path / "defaults.md").read_text().count("| current_std_mps: ") == 3
