"""The study's tables, in Markdown: medians over the seeds, and every run."""

from __future__ import annotations

from typing import Any, Callable, Iterable

import numpy as np

from bench.study.replays import ratio
from bench.svgp.in_process import markdown

Row = dict[str, Any]


def medians(rows: Iterable[Row]) -> str:
    """A line for each case and contestant."""
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        groups.setdefault((row["case"], row["contestant"]), []).append(row)
    return markdown([_line(*key, group) for key, group in groups.items()])


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


def _line(case: str, contestant: str, group: list[Row]) -> Row:
    def of(values: list[Any], measure: Callable[[Any], Any] = np.median) -> float | None:
        known = [value for value in values if value is not None and np.isfinite(value)]
        return float(measure(known)) if known else None

    def median(name: str) -> float | None:
        return of([row[name] for row in group])

    def ratios(name: str, other: str) -> list[float]:
        return [ratio(row, name, other) for row in group]

    accepted = sum(row["closures_accepted"] or 0 for row in group)
    wrong = sum(row["closures_wrong"] or 0 for row in group)
    return {
        "case": case,
        "contestant": contestant,
        "seeds": len(group),
        "DR, m": median("dr_ate_rmse_m"),
        "online, m": median("online_ate_rmse_m"),
        "final, m": median("ate_rmse_m"),
        "aligned, m": median("ate_aligned_rmse_m"),
        "online over ideal": of(ratios("online_ate_rmse_m", "ideal_online_ate_rmse_m")),
        "final over ideal": of(ratios("ate_rmse_m", "ideal_ate_rmse_m")),
        "ideal aligned, m": median("ideal_ate_aligned_rmse_m"),
        "worst final over DR": of(ratios("ate_rmse_m", "dr_ate_rmse_m"), max),
        "worst online over DR": of(ratios("online_ate_rmse_m", "dr_ate_rmse_m"), max),
        "online NEES": median("online_nees"),
        "NEES": median("nees"),
        "closures": median("closures_accepted"),
        "refused": median("closures_refused"),
        "wrong, %": 100.0 * wrong / accepted if accepted else None,
        "prompts that resample": of(ratios("resamplings", "loop_closure_prompts")),
        "founders left": median("founders"),
        "seabed, m": median("seabed_rmse_m"),
        "grid, m": median("grid_rmse_m"),
        "wall, s": median("wall_s"),
    }
