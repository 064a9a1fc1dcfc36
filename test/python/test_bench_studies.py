"""The studies of scales, conditioning and common random numbers, scaled down."""

import numpy as np
import pytest
import torch

from bench import real_files
from bench.svgp import common_random_numbers, conditioning, in_process, scales


def test_a_table_has_a_line_for_each_row():
    rows = [{"case": "a", "error": 0.12345, "n": 3}, {"case": "b", "error": None, "n": 4}]
    expected = "| case | error | n |\n| --- | --- | --- |\n| a | 0.123 | 3 |\n| b | none | 4 |"
    assert in_process.markdown(rows) == expected


# Scales

SMALL = {"S": 49, "M": 200, "steps": 40}


@pytest.fixture(scope="module")
def shallow():
    return scales.study(scales.Case(10.0, 100.0), **SMALL)


def test_stretching_the_area_changes_adam_only(shallow):
    wide = scales.study(scales.Case(10.0, 5000.0, centre_m=500e3), **SMALL)
    for optimizer in ("natgrad", "streaming"):
        # rounding of positions in single precision, over 40 steps
        assert wide[optimizer] == pytest.approx(shallow[optimizer], rel=1e-3)
    # it takes steps of 0.1 m: initially l is half a pitch
    assert wide["adam"]["l (pitches)"] == pytest.approx(0.5, abs=0.01)
    assert abs(shallow["adam"]["l (pitches)"] - 0.5) > 0.05


def test_higher_relief_is_the_same_if_the_initial_values_are_higher_too(shallow):
    initial = {"outputscale_m2": 400.0, "noise_std_m": 6.0}
    deep = scales.study(scales.Case(3000.0, 100.0, 0.0, 60.0, 2.0, initial), **SMALL)
    # rounding of depths of 3000 m in single precision: 0.1 mm, next to a noise of 2 m
    assert deep["natgrad"] == pytest.approx(shallow["natgrad"], rel=1e-2)


def test_surveys_far_away_reach_the_maps_as_near_ones():
    near, far = (scales.simulate(scales.Case(10.0, 100.0, centre_m=c)) for c in (0.0, 500e3))
    assert near.beams.dtype == far.beams.dtype == np.float32
    # half of a unit in the last place of 50 m, and of 500 km in double precision
    np.testing.assert_allclose(far.beams, near.beams, rtol=0.0, atol=4e-6)
    assert near.beams[:, 2].mean() == pytest.approx(-10.0, abs=1.5)
    assert np.ptp(near.z) == pytest.approx(3.0, rel=0.1)
    # line after line: no beam lies further back than a line is wide
    y = near.beams[:, 1]
    assert 9.0 < (np.maximum.accumulate(y) - y).max() < 10.0 + 1e-5


# Conditioning


def test_whitening_first_is_streaming_where_the_condition_is_good():
    case = conditioning.make_case("matern12", 1.0, S=25)
    engine = conditioning._make(case, "streaming", "float64")
    conditioning._train(engine, case)
    assert engine.next_beam == conditioning.BEAMS_IN_LOG
    mean, variance = engine.predict(case.xy)
    expected_mean, expected_variance = conditioning._streamed_exactly(case)
    # sums of 12 million in double precision, times a condition of 10⁴
    np.testing.assert_allclose(mean, expected_mean, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(variance, expected_variance, rtol=1e-6)


def test_experiments_take_effect_and_end():
    case = conditioning.make_case("matern32", 0.02, S=49)
    errors = conditioning.map_errors(case)
    largest = "mean, largest (% of sigma)"
    double, as_it_is = (errors[f"natgrad, {name}"] for name in ("all in double", "as it is"))
    assert double[largest] == 0.0 < as_it_is[largest]
    singles = [errors[f"natgrad, {name} in single"] for name in ("L", "moments")]
    for figures in singles:
        # None: there was no Cholesky factor at all
        assert figures[largest] is None or figures[largest] != as_it_is[largest]
    summed = errors["streaming, sums in single"]
    assert summed[largest] is None or summed[largest] > errors["streaming, as it is"][largest]
    assert conditioning.map_errors(case)["natgrad, as it is"] == as_it_is


def test_the_objective_is_compared_between_precisions():
    errors = conditioning.objective_errors(conditioning.make_case("matern12", 1.0, S=25))
    for figures in errors.values():
        # single precision, on a harmless problem; but not the same numbers
        assert 0.0 < figures["dR"] < 1e-3
        assert figures["ELBO"] < 1e-5
    one, two = torch.tensor([3.0, 4.0]), torch.tensor([3.0, 4.5])
    assert conditioning._relative(two, one) == pytest.approx(0.1)


# Common random numbers


def test_differences_of_log_weights():
    z = np.zeros((1, 2))
    right = np.zeros((1, 2)), np.full((1, 2), 0.07)
    wrong = np.array([[0.4, 0.8]]), np.full((1, 2), 0.07)
    # variance 0.07 + 0.3² = 0.16
    expected = 0.5 * (0.4**2 + 0.8**2) / 0.16
    product = common_random_numbers.product_difference(z, right, wrong)
    np.testing.assert_allclose(product, [expected])
    expected = 30.0 * 2.5 * np.mean(np.log1p(np.array([0.4**2, 0.8**2]) / (4.0 * 0.16)))
    robust = common_random_numbers.robust_difference(z, right, wrong)
    np.testing.assert_allclose(robust, [expected])


@pytest.fixture(scope="module")
def study():
    return common_random_numbers.Study(S=25, M=50, steps=30, beams=2000)


@pytest.mark.parametrize("optimizer", ["adam", "natgrad"])
def test_common_beams_leave_no_difference_between_equal_particles(study, optimizer):
    pairs = common_random_numbers.by_minibatches(study, optimizer, repetitions=3)
    figures = common_random_numbers.compare(study.z, pairs)
    assert set(figures["same history, common beams"].values()) == {0.0}
    for rule in ("product", "robust"):
        name = f"{rule}, std"
        independent = figures["1 m apart, independent beams"][name]
        assert 0.0 < figures["1 m apart, common beams"][name] < independent
        assert figures["same history, independent beams"][name] > 0.0


def test_streaming_whole_logs_leaves_no_difference_between_equal_particles(study):
    pairs = common_random_numbers.by_streaming(study, repetitions=2)
    figures = common_random_numbers.compare(study.z, pairs)
    for kind in ("whole log", "common sample"):
        assert set(figures[f"same history, {kind}"].values()) == {0.0}
    assert figures["same history, independent samples"]["product, std"] > 0.0


# Real files


def test_files_that_are_not_there_are_named(tmp_path):
    (tmp_path / "em710.all").touch()
    complaint = real_files.main(str(tmp_path), str(tmp_path / "out"))
    assert str(tmp_path / "r2sonic2026.xtf") in complaint and "em710" not in complaint
