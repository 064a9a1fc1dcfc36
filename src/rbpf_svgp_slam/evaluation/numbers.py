"""Numbers as a reader of reports and tables sees them."""

from __future__ import annotations

from typing import Any


def fixed(value: float | None, decimals: int) -> str:
    """Format a quantity with so many decimals, so that a column can be compared; – for None."""
    return "–" if value is None else f"{value:.{decimals}f}"


def format_number(value: Any) -> str:
    """Format a quantity for a reader: three significant digits, thousands apart, – for None."""
    if value is None:
        return "–"
    if isinstance(value, dict):
        return ", ".join(f"{key} {format_number(item)}" for key, item in value.items())
    if isinstance(value, (bool, str)):
        return str(value)
    if isinstance(value, int):
        return f"{value:,}".replace(",", "\u202f")
    return f"{value:,.0f}".replace(",", "\u202f") if abs(value) >= 1000 else f"{value:.3g}"


def format_duration(duration_s: float | None) -> str:
    """Format a time for a reader, in seconds, minutes or hours; – for None."""
    if duration_s is None:
        return "–"
    for unit_s, unit in ((3600, "h"), (60, "min")):
        if duration_s >= 2 * unit_s:
            return f"{format_number(duration_s / unit_s)} {unit}"
    return f"{format_number(duration_s)} s"
