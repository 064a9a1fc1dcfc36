"""The three lines that a run ends with."""

from __future__ import annotations

from pathlib import Path
from typing import Any


def summarise(report: dict[str, Any], out_dir: Path) -> str:
    """Dead reckoning's error, the filter's error, and where the report is."""

    def metres(name: str) -> str:
        value = report[name]
        return "unknown" if value is None else f"{value:.2f} m"

    return (
        f"DR error:   ATE {metres('dr_ate_rmse_m')}, final {metres('dr_final_error_m')}\n"
        f"RBPF error: ATE {metres('ate_rmse_m')}, final {metres('final_error_m')}\n"
        f"Report: {(out_dir / 'report.html').resolve()}"
    )
