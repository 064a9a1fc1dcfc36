"""What a change is worth: python3 -m bench.study.compare BEFORE.jsonl AFTER.jsonl.

Of the runs that both files of rows have, survey by survey: the errors after over those before,
geometric means of a case's seeds; and how far off the worst seed is.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from scipy.stats import gmean

from bench.study.replays import ratio, rows_in
from bench.study.tables import of_known
from bench.svgp.in_process import markdown

Row = dict[str, Any]

ERRORS = {
    "online": "online_ate_rmse_m",
    "final": "ate_rmse_m",
    "aligned": "ate_aligned_rmse_m",
}


def compared(before: Path, after: Path) -> str:
    """A table in Markdown, by contestant and case, and a contestant's cases together."""
    known = rows_in(before)
    pairs = [(known[key], row) for key, row in rows_in(after).items() if key in known]
    rows = []
    for contestant in dict.fromkeys(row["contestant"] for _, row in pairs):
        mine = [(old, new) for old, new in pairs if new["contestant"] == contestant]
        for case in dict.fromkeys(new["case"] for _, new in mine):
            of_case = [(old, new) for old, new in mine if new["case"] == case]
            rows.append({"contestant": contestant, "case": case, **_summary(of_case)})
        rows.append({"contestant": contestant, "case": "all", **_summary(mine)})
    return markdown(rows)


def _summary(pairs: list[tuple[Row, Row]]) -> Row:
    summary: Row = {"seeds": len(pairs)}
    for label, name in ERRORS.items():
        ratios = [new[name] / old[name] for old, new in pairs if old[name] and new[name]]
        summary[label] = float(gmean(ratios)) if ratios else None
    for which, label in enumerate(("before", "after")):
        runs = [pair[which] for pair in pairs]
        of_worst = of_known((ratio(run, "ate_rmse_m", "dr_ate_rmse_m") for run in runs), max)
        summary[f"worst final over DR, {label}"] = of_worst
        summary[f"NEES above 2, {label}"] = sum((run["nees"] or 0.0) > 2.0 for run in runs)
    return summary


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("before", type=Path, metavar="BEFORE")
    parser.add_argument("after", type=Path, metavar="AFTER")
    arguments = parser.parse_args()
    for file in (arguments.before, arguments.after):
        if not file.is_file():
            parser.error(f"{file} is not there; expected a study's rows.jsonl")
    print(compared(arguments.before, arguments.after))


if __name__ == "__main__":
    main()
