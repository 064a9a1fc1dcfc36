"""All metrics of one run: which of them a run with something missing still has."""

import numpy as np
import pytest
from made_up_survey import ROUNDING_M, predict_seabed, seabed, without

from rbpf_svgp_slam.metrics.evaluation import evaluate, json_ready


@pytest.mark.parametrize("error_m", [0.0, 0.2])
def test_consistency_of_map_and_beams_is_the_maps_error(run, error_m):
    # One beam a square metre at most has no neighbour that could be nearer than the map below it.
    z = seabed(run.beams[:, :2])
    few = np.random.default_rng(0).permutation(len(z))[:500]
    sparse = without(
        run,
        levelled=np.column_stack([run.levelled[few, :2], z[few]]),
        ping_of_beam=run.ping_of_beam[few],
        predict=lambda xy: (seabed(xy) + error_m, np.full(len(xy), 0.01)),
    )
    found = evaluate(sparse).report["map_consistency_rmse_m"]
    if error_m == 0.0:
        # Cells without error do not count, and roundings are no more than that.
        assert found is None or found < ROUNDING_M
    else:
        assert found == pytest.approx(error_m, rel=0.05)


def test_without_held_out_pings_map_errors_are_null(run):
    report = evaluate(without(run, held_out=np.zeros(len(run.stamp_s), dtype=bool))).report
    assert report["map_rmse_m"] is None and report["grid_rmse_m"] is None
    assert any("no held-out beams" in note for note in report["notes"])


def test_beams_that_the_map_does_not_predict_are_left_out(run):
    def predict_half(xy):
        mean, variance = predict_seabed(xy)
        return np.where(xy[:, 0] < 50, mean, np.nan), variance

    report = evaluate(without(run, predict=predict_half)).report
    # Half of the survey, to within the turns at its ends.
    assert report["map_coverage"] == pytest.approx(0.5, abs=0.1)
    assert report["map_rmse_m"] == pytest.approx(0.12, abs=0.03)
    nowhere = evaluate(without(run, predict=lambda xy: np.full((2, len(xy)), np.nan))).report
    assert nowhere["map_rmse_m"] is None
    assert any("predicts no held-out beam" in note for note in nowhere["notes"])


def test_with_all_pings_held_out_the_grid_says_nothing(run):
    report = evaluate(without(run, held_out=np.ones(len(run.stamp_s), dtype=bool))).report
    assert report["map_rmse_m"] is not None
    assert report["grid_rmse_m"] is None and report["map_msll"] is None
    assert report["grid_coverage"] == 0


def test_beams_that_are_not_finite_are_left_out_and_counted(run):
    levelled = run.levelled.copy()
    levelled[:7] = np.nan
    report = evaluate(without(run, levelled=levelled)).report
    assert any(note.startswith("7 beams are not finite") for note in report["notes"])
    assert report["map_rmse_m"] is not None


def test_json_has_plain_numbers_only():
    value = {"a": np.float32(1.5), "b": np.array([1, np.inf]), "c": (np.int64(2), float("nan"))}
    assert json_ready(value) == {"a": 1.5, "b": [1.0, None], "c": [2, None]}
    assert json_ready(np.bool_(True)) is True
