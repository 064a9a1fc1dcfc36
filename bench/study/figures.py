"""The study's figures: the errors in each case, and all cases beside what the data allow."""

from __future__ import annotations

from typing import Any

import numpy as np

from bench.figures import GUIDE, WIDTH_IN, plain_numbers, plt
from bench.study.replays import ratio
from bench.study.targets import FINAL_OVER_IDEAL, ONLINE_OVER_IDEAL, OVER_DEAD_RECKONING
from rbpf_svgp_slam.figures import figure_style as style

Row = dict[str, Any]

#: Of a case's panels: what is drawn, and the ideal and dead reckoning beside it.
PANELS = {
    "online ATE": ("online_ate_rmse_m", "ideal_online_ate_rmse_m", "dr_ate_rmse_m"),
    "final ATE": ("ate_rmse_m", "ideal_ate_rmse_m", "dr_ate_rmse_m"),
    "final ATE, aligned": (
        "ate_aligned_rmse_m",
        "ideal_ate_aligned_rmse_m",
        "dr_ate_aligned_rmse_m",
    ),
}
#: Of the overview's panels, with the study's target.
RATIOS = {
    "online over ideal filter": ("online_ate_rmse_m", "ideal_online_ate_rmse_m", ONLINE_OVER_IDEAL),
    "final over ideal smoother": ("ate_rmse_m", "ideal_ate_rmse_m", FINAL_OVER_IDEAL),
    "final over dead reckoning": ("ate_rmse_m", "dr_ate_rmse_m", OVER_DEAD_RECKONING),
}
#: Of ticks.
PLACES = (1.0, 2.0, 5.0)
_OURS, _IDEAL, _DR = (
    style.COLOURS["estimate"],
    style.COLOURS["online"],
    style.COLOURS["dead_reckoning"],
)


def of_case(case: str, rows: list[Row]) -> plt.Figure:
    """Every seed's errors by contestant, with their median, the ideal's and dead reckoning's."""
    names = list(dict.fromkeys(row["contestant"] for row in rows))
    labels = ["ideal", *(name.replace(",", ",\n") for name in reversed(names)), "dead reckoning"]
    height_in = 1.2 + 0.32 * sum(1 + label.count("\n") for label in labels)
    figure, panels = plt.subplots(
        1, 3, figsize=(WIDTH_IN, height_in), sharey=True, layout="constrained"
    )
    figure.suptitle(case, fontsize=10)
    by_seed = list({row["seed"]: row for row in rows}.values())
    for axes, (title, (field, ideal, dead_reckoning)) in zip(panels, PANELS.items()):
        _strip(axes, len(names) + 1, [row[dead_reckoning] for row in by_seed], _DR)
        for k, name in enumerate(names):
            errors_m = [row[field] for row in rows if row["contestant"] == name]
            _strip(axes, len(names) - k, errors_m, _OURS)
        _strip(axes, 0, [row[ideal] for row in by_seed], _IDEAL)
        axes.set(title=title, xlabel="m", xscale="log")
        plain_numbers(axes.xaxis, PLACES)
    panels[0].set_yticks(range(len(labels)), labels)
    return figure


def overview(rows: list[Row], contestant: str) -> plt.Figure:
    """The ratios of one contestant in all cases: every seed, the medians, and the targets."""
    mine = [row for row in rows if row["contestant"] == contestant]
    cases = list(dict.fromkeys(row["case"] for row in mine))
    figure, panels = plt.subplots(
        1, 3, figsize=(WIDTH_IN, 1.2 + 0.26 * len(cases)), sharey=True, layout="constrained"
    )
    figure.suptitle(contestant, fontsize=10)
    for axes, (title, (field, other, target)) in zip(panels, RATIOS.items()):
        for k, case in enumerate(reversed(cases)):
            ratios = [ratio(row, field, other) for row in mine if row["case"] == case]
            _strip(axes, k, ratios, _OURS)
        axes.axvline(target, **GUIDE)
        axes.set(title=title, xscale="log")
        plain_numbers(axes.xaxis, PLACES)
    panels[0].set_yticks(range(len(cases)), list(reversed(cases)))
    return figure


def _strip(axes: plt.Axes, y: float, values: list[float | None], colour: str) -> None:
    """A dot for each seed, and a line at their median."""
    known = np.array([v for v in values if v is not None and np.isfinite(v)])
    if len(known) == 0:
        return
    axes.plot(known, np.full(len(known), y), "o", color=colour, markersize=3, alpha=0.5)
    axes.plot([np.median(known)] * 2, [y - 0.35, y + 0.35], color=colour, linewidth=1.6)
