"""What is said of a survey while it goes on."""

from __future__ import annotations

from datetime import timedelta
from typing import Any, NamedTuple


class Row(NamedTuple):
    """A line of the picture."""

    label: str
    value: str
    alarming: bool = False


def status_rows(
    status: Any, survey_s: float | None, ate_m: float | None, dead_reckoning_ate_m: float | None
) -> list[Row]:
    """Rows for a FilterStatus.

    survey_s: since the first ping; ATE of the track so far, and of dead reckoning. None: unknown.
    """
    lost = status.pings_dropped + status.pings_rejected
    rows = [
        Row("time", "–" if survey_s is None else str(timedelta(seconds=int(survey_s)))),
        Row("N_eff", f"{status.n_eff:.0f} of {status.particles}"),
        Row("closures", f"{status.closures}, {status.closures_refused} refused"),
        Row("pings", f"{status.pings}, {lost} lost", alarming=lost > 0),
        Row("maps ready", f"{status.maps_ready} of {status.particles}"),
    ]
    if ate_m is not None and dead_reckoning_ate_m is not None:
        value = f"{ate_m:.2f} m, DR {dead_reckoning_ate_m:.2f} m"
        rows.insert(1, Row("ATE", value, alarming=ate_m > dead_reckoning_ate_m))
    return rows
