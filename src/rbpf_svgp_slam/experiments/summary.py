"""summary.md of an experiment: its runs in one table, with the paper's numbers beside ours."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from rbpf_svgp_slam.evaluation.page import format_number
from rbpf_svgp_slam.experiments.plan import Configuration, Experiment
from rbpf_svgp_slam.experiments.runner import SETTINGS

# Column, and the field of report.json; a second one is the field of its dictionary.
_COLUMNS = {
    "J": "particles",
    "B": "nodes",
    "steps per particle": "iterations_per_particle",
    "paper": "iterations_per_particle",
    "consistency RMSE, m": "consistency_rmse_m",
    "map RMSE, m": "map_rmse_m",
}


def write_summary(plan: Experiment, folders: list[Path], out_dir: Path) -> Path:
    """Write out_dir/summary.md; returns its path."""
    path = out_dir / "summary.md"
    return path
