"""What the study aims at, beside what a contestant reaches over all of its cases."""

from __future__ import annotations

from typing import Any, Callable, Iterable

import numpy as np
from scipy.stats import gmean

from bench.peers.peer_runs import PEERS
from bench.study.cases import cases
from bench.study.replays import ratio
from bench.study.tables import of_known, wrong_percent
from bench.svgp.in_process import markdown

Row = dict[str, Any]

#: An ATE over another one, at most.
ONLINE_OVER_IDEAL, FINAL_OVER_IDEAL, OVER_DEAD_RECKONING, OVER_BEST_PEER = 1.3, 1.5, 1.1, 1.1
#: Seabeds whose relief is below 0.3 m (bench/study/relief.py): no method finds what is not there.
LITTLE_RELIEF = ("flat", "block_b", "slope")


def against_targets(rows: Iterable[Row], contestant: str) -> str:
    """A table in Markdown: each target, and what was reached; over no runs at all: none."""
    rows = list(rows)
    mine = [row for row in rows if row["contestant"] == contestant]
    relief = [row for row in mine if cases([row["case"]])[0].seabed not in LITTLE_RELIEF]
    accepted = sum(row["closures_accepted"] or 0 for row in mine)
    shown: list[tuple[str, Any, Any]] = [
        (
            "online over the ideal filter, median of the runs with relief",
            ONLINE_OVER_IDEAL,
            of_known(ratio(row, "online_ate_rmse_m", "ideal_online_ate_rmse_m") for row in relief),
        ),
        (
            "final over the ideal smoother, the same",
            FINAL_OVER_IDEAL,
            of_known(ratio(row, "ate_rmse_m", "ideal_ate_rmse_m") for row in relief),
        ),
        (
            "that after alignment, which was not aimed at",
            None,
            of_known(
                ratio(row, "ate_aligned_rmse_m", "ideal_ate_aligned_rmse_m") for row in relief
            ),
        ),
        (
            "online over dead reckoning, worst of all runs",
            OVER_DEAD_RECKONING,
            _worst(mine, "online_ate_rmse_m"),
        ),
        (
            "final over dead reckoning, worst of all runs",
            OVER_DEAD_RECKONING,
            _worst(mine, "ate_rmse_m"),
        ),
        (f"wrong of {accepted} closures, %", 1.0, wrong_percent(mine)),
        # Over runs whose covariances are right it has a mean of 1. The median is less, since few
        # numbers make most of a run's error: 0.69 (of chi square) where they are two.
        ("online NEES, means of the cases", "0.5 to 2", _range(mine, "online_nees", np.mean)),
        ("NEES, means of the cases", "0.5 to 2", _range(mine, "nees", np.mean)),
        ("online NEES, medians of the cases", "0.5 to 2", _range(mine, "online_nees")),
        ("NEES, medians of the cases", "0.5 to 2", _range(mine, "nees")),
        (
            "prompts that resample, median of all runs",
            0.5,
            of_known(ratio(row, "resamplings", "loop_closure_prompts") for row in mine),
        ),
    ]
    for label, name in (("online", "online_ate_rmse_m"), ("final", "ate_rmse_m")):
        over, case = _over_best_peer(rows, contestant, name)
        if case:
            shown.append((f"{label} over the best peer, worst case ({case})", OVER_BEST_PEER, over))
    return markdown(
        [
            {"over all cases": what, "aimed at": at, "reached": reached}
            for what, at, reached in shown
        ]
    )


def _worst(rows: list[Row], name: str) -> float | None:
    return of_known((ratio(row, name, "dr_ate_rmse_m") for row in rows), max)


def _range(
    rows: list[Row], name: str, summary: Callable[[list[float]], Any] = np.median
) -> str | None:
    """Least and largest of the cases' summaries over their seeds, with the cases."""
    values: dict[str, list[float | None]] = {}
    for row in rows:
        values.setdefault(row["case"], []).append(row[name])
    of_cases = {case: of_known(of_case, summary) for case, of_case in values.items()}
    known = {case: value for case, value in of_cases.items() if value is not None}
    if not known:
        return None
    least, largest = (pick(known, key=known.__getitem__) for pick in (min, max))
    return f"{known[least]:.2g} ({least}) to {known[largest]:.2g} ({largest})"


def _over_best_peer(rows: list[Row], contestant: str, name: str) -> tuple[float, str]:
    """The largest ratio of one case, and the case; where no peer has run: no case.

    Geometric mean over the seeds that both have: a survey's turn about its start, which is most of
    an ATE and varies between seeds, is in both.
    """
    worst = (0.0, "")
    mine = {
        (row["case"], row["seed"]): row[name] for row in rows if row["contestant"] == contestant
    }
    for peer in PEERS:
        ratios: dict[str, list[float]] = {}
        for row in rows:
            other = mine.get((row["case"], row["seed"]))
            if row["contestant"] == peer and other and row[name]:
                ratios.setdefault(row["case"], []).append(other / row[name])
        for case, of_case in ratios.items():
            worst = max(worst, (float(gmean(of_case)), f"{case}, {peer}"))
    return worst
