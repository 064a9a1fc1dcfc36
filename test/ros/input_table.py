#!/usr/bin/env python3
"""Runs the bag cases and prints what has come of them as the Markdown table of docs/inputs.md."""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Iterable

from bag_cases.expected import Case
from bag_cases.registry import CASES
from input_runs import LIVE, OFFLINE, TIME_LIMIT_S, Run, Workshop, problems

DOCUMENT = Path(__file__).parents[2] / "docs" / "inputs.md"
BEGIN, END = "<!-- cases: begin -->", "<!-- cases: end -->"
HEAD = """| case | kind | what comes in | offline | live | as expected |
|---|---|---|---|---|---|"""
NOT_RUN = "–"
MOST_CHARACTERS = 150


def main() -> int:
    """Exit status 1 if a case has not come out as expected."""
    parser = argparse.ArgumentParser(prog="tools/inputs.sh", description=__doc__)
    add = parser.add_argument
    add("--only", nargs="+", metavar="NAME", choices=CASES, default=list(CASES), help="cases")
    add("--live", action="store_true", help="replay each bag through the live nodes, too")
    add("--write", action="store_true", help=f"put the table into {DOCUMENT.name}")
    add("--time-limit", type=float, default=TIME_LIMIT_S, metavar="SECONDS", help="of a run")
    add("--jobs", type=int, default=1, help="runs at a time; each waits more than it computes")
    add("--folder", type=Path, help="where bags, outputs and run folders are kept")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.folder or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        workshop = Workshop(folder.resolve(), options.time_limit)
        rows, wrong = _rows(workshop, options)
    if options.write:
        write_table(rows)
    if wrong:
        print("\n" + "\n".join(wrong), file=sys.stderr)
    return 1 if wrong else 0


def _rows(workshop: Workshop, options: argparse.Namespace) -> tuple[list[str], list[str]]:
    """Rows of the table, which are printed as they come, and what was not as expected."""
    print(HEAD, flush=True)
    rows, wrong = [], []
    modes = (OFFLINE, LIVE) if options.live else (OFFLINE,)
    with ThreadPoolExecutor(options.jobs) as pool:
        for name, (results, odd) in zip(
            options.only, pool.map(lambda name: _try(workshop, CASES[name], modes), options.only)
        ):
            rows.append(_row(CASES[name], results, odd))
            wrong += [f"{name}, {problem}" for problem in odd]
            print(rows[-1], flush=True)
    return rows, wrong


def _try(workshop: Workshop, case: Case, modes: Iterable[str]) -> tuple[dict, list[str]]:
    """What has come of a case in each mode, and what was not as expected."""
    results, odd = {}, []
    for mode in modes:
        if mode == LIVE and case.not_live:
            results[mode] = f"{NOT_RUN} ({case.not_live})"
            continue
        survey, run = workshop.run(case, mode)
        (workshop.folder / f"{case.name}_{mode}.log").write_text(run.output, encoding="utf-8")
        results[mode] = summary(run)
        odd += [f"{mode}: {problem}" for problem in problems(case, mode, survey, run)]
    return results, odd


def _row(case: Case, results: dict[str, str], odd: list[str]) -> str:
    offline, live = (results.get(mode, NOT_RUN) for mode in (OFFLINE, LIVE))
    verdict = "no: " + "; ".join(odd) if odd else "yes"
    cells = [f"`{case.name}`", case.kind, case.comes_in, offline, live, verdict]
    return "| " + " | ".join(cell.replace("|", "/") for cell in cells) + " |"


def summary(run: Run) -> str:
    """A run in a line."""
    if run.status is None:
        return "does not end"
    if run.report is None:
        return f"exit status {run.status}: {_gist(run.last_lines)}"
    report = run.report
    words = [f"{report['pings']} pings"]
    words += [f"{row['count']} × {reason}" for reason, row in run.refused.items()]
    words += run.findings
    if report["ate_rmse_m"] is not None:
        words.append(f"ATE {report['ate_rmse_m']:.1f} m, DR {report['dr_ate_rmse_m']:.1f} m")
    return "; ".join(words)


def _gist(lines: str) -> str:
    """What the run has said of its end, without paths and times."""
    text = " ".join(lines.rpartition("No report: ")[2].split("run_launch.py:")[0].split())
    text = re.sub(r"/\S*/(?=[^/\s]+\.bag)", "", text)
    return text if len(text) <= MOST_CHARACTERS else text[: MOST_CHARACTERS - 1] + "…"


def write_table(rows: list[str]) -> None:
    """Rows of cases that were not run stay as they are."""
    text = DOCUMENT.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    old, after = rest.split(END)
    of_case = {
        row.split("|")[1].strip(" `"): row for row in [*old.splitlines(), *rows] if "`" in row
    }
    table = [of_case[name] for name in CASES if name in of_case]
    content = "\n".join([BEGIN, HEAD, *table, END])
    DOCUMENT.write_text(f"{before}{content}{after}", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
