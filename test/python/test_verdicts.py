"""The report says first where it is worse than doing without the filter or the map."""

import pytest

from rbpf_svgp_slam.evaluation.numbers import fixed
from rbpf_svgp_slam.metrics.verdicts import verdicts

GOOD = {
    "ate_rmse_m": 1.0,
    "dr_ate_rmse_m": 2.0,
    "map_rmse_on_grid_beams_m": 0.1,
    "seabed_rmse_on_grid_beams_m": 0.1,
    "grid_rmse_m": 0.2,
    "pings": 100,
    "pings_dropped": 0,
}


def test_a_good_run_needs_no_warning():
    assert verdicts(GOOD) == []


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        (
            {"ate_rmse_m": 2.5},
            "The filter is worse than dead reckoning: position error 2.500 m against 2.000 m "
            "(RMS).",
        ),
        (
            {"map_rmse_on_grid_beams_m": 0.3},
            "The best particle's map is worse than a plain 1 m grid of cell means: error at "
            "held-out beams 0.300 m against 0.200 m (RMS).",
        ),
        (
            {"seabed_rmse_on_grid_beams_m": 0.25},
            "The seabed is worse than a plain 1 m grid of cell means: error at held-out beams "
            "0.250 m against 0.200 m (RMS).",
        ),
        ({"pings_dropped": 25}, "25 of 125 pings were lost on the way in."),
    ],
)
def test_what_is_worse_is_said_with_both_figures(changes, expected):
    assert verdicts({**GOOD, **changes}) == [expected]


def test_nothing_is_claimed_of_what_is_not_known():
    assert verdicts({**GOOD, "ate_rmse_m": None, "grid_rmse_m": None}) == []
    assert verdicts({}) == []


def test_numbers_of_a_column_have_the_same_decimals():
    assert [fixed(value, 3) for value in (0.5, 12.0, None)] == ["0.500", "12.000", "–"]
