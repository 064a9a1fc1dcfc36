"""What a reader of a report must be told first: where the result is worse than doing without it."""

from __future__ import annotations

from typing import Any

_WORSE = "worse than a plain 1 m grid of cell means: error at held-out beams"


def verdicts(report: dict[str, Any]) -> list[str]:
    """Sentences, from a report; none if there is nothing to warn of."""
    found = []
    for ours, other, sentence in (
        ("ate_rmse_m", "dr_ate_rmse_m", "The filter is worse than dead reckoning: position error"),
        ("map_rmse_on_grid_beams_m", "grid_rmse_m", f"The best particle's map is {_WORSE}"),
        ("seabed_rmse_on_grid_beams_m", "grid_rmse_m", f"The seabed is {_WORSE}"),
    ):
        a, b = report.get(ours), report.get(other)
        if a is not None and b is not None and a > b:
            found.append(f"{sentence} {a:.3f} m against {b:.3f} m (RMS).")
    lost, taken = report.get("pings_dropped") or 0, report.get("pings") or 0
    if lost:
        found.append(f"{lost} of {lost + taken} pings were lost on the way in.")
    return [*found, *(report.get("findings") or [])]
