"""The lines that a run ends with."""

from __future__ import annotations

from pathlib import Path
from typing import Any


def summarise(report: dict[str, Any], out_dir: Path) -> str:
    """The filter's errors beside dead reckoning's, the seabed's beside a plain grid's, the
    closures, and where the report is.

    report: of report.json, which may be older than some of its fields.
    """

    def metres(name: str) -> str:
        value = report.get(name)
        return "unknown" if value is None else f"{value:.2f} m"

    lines = ["RBPF error: unknown, for there is no ground truth"]
    if report.get("ate_rmse_m") is not None:
        lines = [
            f"RBPF error: online ATE {metres('online_ate_rmse_m')}, "
            f"final ATE {metres('ate_rmse_m')} (DR {metres('dr_ate_rmse_m')})",
            f"At the end: {metres('final_error_m')} (DR {metres('dr_final_error_m')})",
        ]
    if report.get("ideal_ate_rmse_m") is not None:
        lines.append(
            f"Ideal:      online ATE {metres('ideal_online_ate_rmse_m')}, "
            f"final ATE {metres('ideal_ate_rmse_m')}"
        )
    if report.get("seabed_rmse_on_grid_beams_m") is not None:
        lines.append(
            f"Seabed:     {report['seabed_rmse_on_grid_beams_m']:.3f} m off at held-out beams "
            f"(1 m grid {report['grid_rmse_m']:.3f} m)"
        )
    if report.get("closures"):
        lines.append(f"Closures:   {_closures(report)}")
    return "\n".join([*lines, f"Report: {(out_dir / 'report.html').resolve()}"])


def _closures(report: dict[str, Any]) -> str:
    refused, wrong = sum(report["closures_refused"].values()), report["closures_wrong"]
    wrong = "" if wrong is None else f", {wrong} wrong"
    return f"{report['closures_accepted']} accepted{wrong}; {refused} refused"
