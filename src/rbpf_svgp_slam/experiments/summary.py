"""summary.md of an experiment: its runs side by side, with the paper's numbers, and figures."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rbpf_svgp_slam.evaluation.numbers import format_number
from rbpf_svgp_slam.experiments.plan import Configuration, Experiment
from rbpf_svgp_slam.experiments.resources import Usage
from rbpf_svgp_slam.experiments.runner import RESOURCES, SETTINGS

# Label, and path in report.json. Where the paper has the number too, its row follows. Its
# consistency error differs between configurations that place the passes alike: it is of the maps.
_ROWS = (
    ("steps per particle", "iterations_per_particle"),
    ("map RMSE at held-out beams, m", "map_rmse_m"),
    ("the same, mean of up to 10 particles' maps", "sampled_map_rmse_m/mean"),
    ("the same, the worst of them", "sampled_map_rmse_m/worst"),
    ("seabed RMSE at held-out beams, m", "seabed_rmse_m"),
    ("RMSE of a 1 m grid of cell means, m", "grid_rmse_m"),
    ("map MSLL, nats", "map_msll"),
    ("consistency RMSE of map and beams, m", "map_consistency_rmse_m"),
    ("consistency RMSE of the passes, m", "consistency_rmse_m"),
    ("the same, dead reckoning", "dr_consistency_rmse_m"),
    ("the same, true track", "ground_truth_consistency_rmse_m"),
    ("ATE, m", "ate_rmse_m"),
    ("ATE of dead reckoning, m", "dr_ate_rmse_m"),
    ("ATE after alignment, m", "ate_aligned_rmse_m"),
    ("the same, dead reckoning", "dr_ate_aligned_rmse_m"),
    ("final error, m", "final_error_m"),
    ("final error of dead reckoning, m", "dr_final_error_m"),
    ("loop-closure prompts", "loop_closure_prompts"),
    ("resamplings", "resamplings"),
    ("pings", "pings"),
    ("pings lost", "pings_dropped"),
    ("age of pings, 99th percentile, s", "ping_age_p99_s"),
    ("beams", "beams"),
    ("survey, s", "duration_s"),
    ("taken, s", "wall_s"),
    ("times real time", "real_time_factor"),
)
_PAPER_LABELS = {
    "iterations_per_particle": "*the paper's Adam steps per particle*",
    "map_consistency_rmse_m": "*the paper's consistency RMSE, m*",
}


@dataclass(frozen=True)
class Row:
    """A configuration and what its run has left."""

    configuration: Configuration
    folder: Path
    report: dict[str, Any]
    facts: dict[str, Any]  # settings, machine, commit
    usage: Usage


def read_rows(plan: Experiment, folders: list[Path]) -> list[Row]:
    """The finished runs."""
    by_name = {configuration.name: configuration for configuration in plan.configurations}
    return [
        Row(
            by_name[folder.name],
            folder,
            json.loads((folder / "report.json").read_text()),
            json.loads((folder / SETTINGS).read_text()),
            Usage.load(folder / RESOURCES),
        )
        for folder in folders
    ]


def write_summary(plan: Experiment, rows: list[Row], figures: list[Path], out_dir: Path) -> Path:
    """Write out_dir/summary.md; figures: PNG files to be shown below the tables."""
    first = rows[0].facts
    machine = first["machine"]
    speed = "live" if plan.live else "read directly (offline.launch)"
    header, metrics = [""] + [title(row) for row in rows], _metrics(rows)
    has_paper = any(label in _PAPER_LABELS.values() for label, *_ in metrics)
    lines = [
        f"# {plan.title}",
        "",
        f"Mission `{plan.mission}`, scale {first['settings']['scale']:g}, "
        f"seed {first['settings']['seed']}, {speed}. {machine['cores']} cores of {machine['cpu']}, "
        f"{machine['memory_gb']:g} GB; commit {first['commit']}. Each run's `parameters.yaml` has "
        "its parameters." + has_paper * " The paper's numbers are of surveys in full length.",
        "",
        *_table(header, metrics),
        "",
        "Processors kept busy (mean over the whole launch, its start and the report included), and "
        "resident memory (largest), of this machine:",
        "",
        *_table(header, _resources(rows)),
        "",
    ]
    lines += [f"![{path.stem}]({path.relative_to(out_dir)})" for path in figures]
    summary = out_dir / "summary.md"
    summary.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return summary


def title(row: Row) -> str:
    """Of a column or a curve: what the filter ran with, which a user's overlay may change."""
    particles, nodes = _sizes(row)
    engine = row.configuration.engine
    return f"J = {particles}, B = {nodes}" + ("" if engine == "svgp" else f", {engine}")


def _sizes(row: Row) -> tuple[int, int]:
    """J and B that the filter ran with."""
    parameters = row.facts["settings"]["parameters"]
    return parameters["particles"], parameters["nodes"]


def _paper(row: Row, path: str) -> float | None:
    """What the paper reports of this J and B."""
    planned = row.configuration
    return planned.paper.get(path) if _sizes(row) == (planned.particles, planned.nodes) else None


def _metrics(rows: list[Row]) -> list[list[str]]:
    """A line for each quantity that at least one run has."""
    lines = []
    for label, path in _ROWS:
        values = [_at(row.report, path) for row in rows]
        if any(value is not None for value in values):
            lines.append([label] + [shown(value) for value in values])
        papers = [_paper(row, path) for row in rows]
        if any(value is not None for value in papers):
            lines.append([_PAPER_LABELS[path]] + [shown(value) for value in papers])
    return lines


def shown(value: Any) -> str:
    """As in a report, but with a fourth digit: configurations differ by percents."""
    if isinstance(value, float) and abs(value) < 1000:
        return f"{value:.4g}"
    return format_number(value)


def _resources(rows: list[Row]) -> list[list[str]]:
    groups = sorted({name for row in rows for name in row.usage.cores})
    lines = []
    for name in groups:
        busy = [row.usage.cores.get(name) for row in rows]
        largest = [row.usage.rss_mb.get(name) for row in rows]
        cells = [
            "–" if cores is None or not cores.size else f"{cores.mean():.2f}, {memory.max():.0f} MB"
            for cores, memory in zip(busy, largest)
        ]
        lines.append([name] + cells)
    return lines


def _table(header: list[str], lines: list[list[str]]) -> list[str]:
    """In Markdown."""
    rows = [header, ["---"] * len(header), *lines]
    return [f"| {' | '.join(row)} |" for row in rows]


def _at(report: dict[str, Any], path: str) -> Any:
    value: Any = report
    for name in path.split("/"):
        value = value.get(name) if isinstance(value, dict) else None
    return value
