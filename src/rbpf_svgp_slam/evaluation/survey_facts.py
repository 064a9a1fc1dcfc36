"""What the report says of a survey before anything else, in a hydrographer's words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rbpf_svgp_slam.charts import s44, uncertainty
from rbpf_svgp_slam.evaluation.numbers import fixed, format_number
from rbpf_svgp_slam.figures.chart_figures import LOCAL_FRAME

# From here on in kilometres.
_KILOMETRES_FROM_M, _SQUARE_KILOMETRES_FROM_M2 = 10_000.0, 1e6


@dataclass(frozen=True)
class OrderRow:
    """A row of the table of S-44's orders."""

    name: str
    allowed_m: float  # total vertical uncertainty, 95 %, at the median depth
    share: float  # of the surveyed area that keeps it


def survey_facts(report: dict[str, Any]) -> dict[str, str]:
    """Names and values with their units, from a report."""
    depths = [fixed(report[f"depth_{name}_m"], 1) for name in ("min", "median", "max")]
    facts = {
        "area surveyed": _area(report["area_m2"]),
        "track length": _length(report["track_length_m"]),
        "depth: least · median · greatest": f"{' · '.join(depths)} m",
        "soundings": format_number(report["beams"]),
        "soundings per m², median": format_number(report["beams_per_m2"]),
        "total vertical uncertainty (95 %), median": _spread(report["tvu95_m"]),
        "horizontal CRS": LOCAL_FRAME,
        "vertical datum": "water's surface; no tide or datum applied",
    }
    crs, vertical = report["crs"], report["vertical_crs"]
    if crs is not None:
        facts["horizontal CRS"] = f"EPSG:{crs['epsg']}, {crs['name']}"
        facts["grid convergence at the origin"] = f"{report['map_turned_by_deg']:+.3f}°"
        facts["vertical datum"] = (
            f"water's surface, taken as {vertical['name']} (EPSG:{vertical['epsg']}); no tide "
            "applied"
        )
    return facts


def order_rows(report: dict[str, Any]) -> list[OrderRow]:
    """S-44's orders, the strictest first; none where the uncertainty is not known."""
    shares = report["s44_order_shares"]
    if shares is None:
        return []
    within = s44.shares_within(shares)
    return [
        OrderRow(order.name, float(order.largest_m(report["depth_median_m"])), within[order.name])
        for order in reversed(s44.ORDERS)
    ]


def caveats(has_covariance: bool) -> str:
    """What the uncertainties hold, and what they lack."""
    held = uncertainty.INCLUDED if has_covariance else uncertainty.WITHOUT_TRAJECTORY
    return f"{s44.BY_TVU_ALONE} TVU is 1.96 σ. σ: {held[0].lower()}{held[1:]} {uncertainty.MISSING}"


def _area(area_m2: float | None) -> str:
    if area_m2 is not None and area_m2 >= _SQUARE_KILOMETRES_FROM_M2:
        return f"{format_number(area_m2 / 1e6)} km²"
    return f"{format_number(area_m2)} m²"


def _length(length_m: float | None) -> str:
    if length_m is not None and length_m >= _KILOMETRES_FROM_M:
        return f"{format_number(length_m / 1000)} km"
    if length_m is not None and length_m < 10.0:
        return f"{fixed(length_m, 2)} m"  # of a ship alongside
    return f"{format_number(length_m)} m"


def _spread(spread_m: float | None) -> str:
    """Centimetres, and millimetres where there are few of those."""
    is_small = spread_m is not None and spread_m < 0.1
    return f"{fixed(spread_m, 3 if is_small else 2)} m"
