"""The study's tables, in Markdown: by case and contestant over the seeds, and every run."""

from __future__ import annotations

from typing import Any, Callable, Iterable

import numpy as np

from bench.study.replays import ratio
from bench.svgp.in_process import markdown

Row = dict[str, Any]


def errors(rows: Iterable[Row]) -> str:
    """What is reached, beside dead reckoning and the ideal: medians, and the worst seed."""
    return markdown([{**_named(group), **_errors(group)} for group in _groups(rows)])


def honesty(rows: Iterable[Row]) -> str:
    """How sure, by how many closures and resamplings, and at what cost: medians and shares."""
    return markdown([{**_named(group), **_honesty(group)} for group in _groups(rows)])


def every(rows: Iterable[Row]) -> str:
    """A line for each run."""
    shown = [("DR, m", "dr_ate_rmse_m"), ("online, m", "online_ate_rmse_m")]
    shown += [("ideal online, m", "ideal_online_ate_rmse_m"), ("final, m", "ate_rmse_m")]
    shown += [("ideal, m", "ideal_ate_rmse_m"), ("aligned, m", "ate_aligned_rmse_m")]
    shown += [("ideal aligned, m", "ideal_ate_aligned_rmse_m"), ("online NEES", "online_nees")]
    shown += [("NEES", "nees"), ("closures", "closures_accepted"), ("wrong", "closures_wrong")]
    return markdown(
        [
            {
                **{name: row[name] for name in ("case", "seed", "contestant")},
                **{label: row[field] for label, field in shown},
                "commit": row["commit"],
            }
            for row in rows
        ]
    )


def _groups(rows: Iterable[Row]) -> list[list[Row]]:
    """By case and contestant."""
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        groups.setdefault((row["case"], row["contestant"]), []).append(row)
    return list(groups.values())


def _named(group: list[Row]) -> Row:
    first = group[0]
    return {"case": first["case"], "contestant": first["contestant"], "seeds": len(group)}


def _errors(group: list[Row]) -> Row:
    return {
        "DR, m": _median(group, "dr_ate_rmse_m"),
        "online, m": _median(group, "online_ate_rmse_m"),
        "final, m": _median(group, "ate_rmse_m"),
        "aligned, m": _median(group, "ate_aligned_rmse_m"),
        "ideal aligned, m": _median(group, "ideal_ate_aligned_rmse_m"),
        "online over ideal": of_known(
            _ratios(group, "online_ate_rmse_m", "ideal_online_ate_rmse_m")
        ),
        "final over ideal": of_known(_ratios(group, "ate_rmse_m", "ideal_ate_rmse_m")),
        "worst online over DR": of_known(_ratios(group, "online_ate_rmse_m", "dr_ate_rmse_m"), max),
        "worst final over DR": of_known(_ratios(group, "ate_rmse_m", "dr_ate_rmse_m"), max),
    }


def _honesty(group: list[Row]) -> Row:
    return {
        "online NEES": _median(group, "online_nees"),
        "NEES": _median(group, "nees"),
        "closures": _median(group, "closures_accepted"),
        "refused": _median(group, "closures_refused"),
        "wrong, %": wrong_percent(group),
        "prompts that resample": of_known(_ratios(group, "resamplings", "loop_closure_prompts")),
        "founders left": _median(group, "founders"),
        "seabed, m": _median(group, "seabed_rmse_m"),
        "1 m grid, m": _median(group, "grid_rmse_m"),
        "wall, s": _median(group, "wall_s"),
    }


def of_known(values: Iterable[Any], measure: Callable[[Any], Any] = np.median) -> float | None:
    """A measure of those values that are known; None if none is."""
    known = [value for value in values if value is not None and np.isfinite(value)]
    return float(measure(known)) if known else None


def wrong_percent(group: list[Row]) -> float | None:
    """Of all accepted closures; None if there are none."""
    accepted = sum(row["closures_accepted"] or 0 for row in group)
    wrong = sum(row["closures_wrong"] or 0 for row in group)
    return 100.0 * wrong / accepted if accepted else None


def _median(group: list[Row], name: str) -> float | None:
    return of_known([row[name] for row in group])


def _ratios(group: list[Row], name: str, other: str) -> list[float]:
    return [ratio(row, name, other) for row in group]
