"""The command line of the study; started by tools/study.sh."""

from __future__ import annotations

import argparse
import itertools
import json
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Lock
from typing import Any

from bench.figures import save
from bench.paths import ROOT
from bench.peers.peer_runs import PEERS
from bench.study import figures, tables
from bench.study.cases import Case, cases
from bench.study.contestants import CONTESTANTS, overlay
from bench.study.replays import RunFailed, key_of, make_survey, replay, rows_in, run_peer
from bench.study.targets import against_targets
from rbpf_svgp_slam import cpu
from rbpf_svgp_slam.simulation import SurveyError

#: Nothing was chosen on these and the next ones.
FIRST_SEED = 201

_DESCRIPTION = """Run contestants on simulated surveys by offline replay, so that the results do not
depend on the machine's speed, and print what they reach beside dead reckoning and the ideal
smoother and filter. DIR gets a line for each run in rows.jsonl, the tables in study.md (the first
holds the first contestant against the study's targets), a figure for each case, one of the first
contestant in all cases, and the runs' reports and tracks. What rows.jsonl has is not run again: an
interrupted study goes on."""


def main() -> int:
    """Run the study; returns the exit status."""
    arguments = _parse()
    cpu.prepare(threads=1)
    try:
        chosen = cases(arguments.cases)
        for name in arguments.contestants:
            if name not in PEERS:
                overlay(name)
    except ValueError as error:
        print(f"tools/study.sh: error: {error}", file=sys.stderr)
        return 2
    out = arguments.out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.seeds)
    study = Study(out, arguments.contestants)
    # All cases of one seed before the next seed: whenever it is interrupted, no case is left out.
    surveys = [(case, seed) for seed, case in itertools.product(seeds, chosen)]
    failures = []
    if not arguments.no_runs:
        with ThreadPoolExecutor(arguments.jobs) as pool:
            failures = [text for text in pool.map(lambda one: study.run(*one), surveys) if text]
    rows = study.rows(surveys)
    first = arguments.contestants[0]
    shown = [against_targets(rows, first), tables.errors(rows), tables.honesty(rows)]
    text = "\n\n".join([*shown, tables.every(rows)])
    (out / "study.md").write_text(text + "\n", encoding="utf-8")
    for case in dict.fromkeys(row["case"] for row in rows):
        figure = figures.of_case(case, [row for row in rows if row["case"] == case])
        save(figure, out / f"{case}.png")
    save(figures.overview(rows, first), out / "overview.png")
    print("\n\n".join(shown))
    for failure in failures:
        print(f"tools/study.sh: error: {failure}", file=sys.stderr)
    return 1 if failures else 0


class Study:
    """Its folder."""

    def __init__(self, out: Path, contestants: list[str]) -> None:
        self._out = out
        self._contestants = contestants
        self._file = out / "rows.jsonl"
        self._lock = Lock()
        self._known = rows_in(self._file)

    def run(self, case: Case, seed: int) -> str:
        """What has still to be run on this survey; returns what failed, if anything did.

        The bag goes when all is done.
        """
        missing = [c for c in self._contestants if (case.name, seed, c) not in self._known]
        for contestant in missing:
            folder = self._out / f"{case.name}_{seed}" / contestant.replace("/", ".")
            row = {"case": case.name, "seed": seed, "contestant": contestant}
            try:
                if contestant in PEERS:
                    self._keep({**row, **run_peer(contestant, case, seed, folder)})
                else:
                    bag = make_survey(case, seed, self._out)
                    self._keep({**row, **replay(contestant, seed, bag, folder)})
            except (RunFailed, SurveyError) as error:
                return str(error)
        for path in self._out.glob(f"{case.name}_{seed}.*"):
            path.unlink()
        return ""

    def _keep(self, row: dict[str, Any]) -> None:
        with self._lock, self._file.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")
            self._known[key_of(row)] = row
            print(json.dumps(row), flush=True)

    def rows(self, surveys: list[tuple[Case, int]]) -> list[dict[str, Any]]:
        """Of these surveys and this study's contestants, by case, contestant and seed."""
        names = list(dict.fromkeys(case.name for case, _ in surveys))
        seeds = list(dict.fromkeys(seed for _, seed in surveys))
        keys = (
            (case, seed, contestant)
            for case, contestant, seed in itertools.product(names, self._contestants, seeds)
        )
        return [self._known[key] for key in keys if key in self._known]


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="tools/study.sh", description=_DESCRIPTION)
    add = parser.add_argument
    add("out", nargs="?", type=Path, default=ROOT / "out" / "study", metavar="DIR")
    add(
        "--cases",
        nargs="+",
        default=["single"],
        metavar="CASE",
        help="names such as base, rippled, outliers5+cheap; single: the base and what differs "
        "from it in one thing; all: everything with everything; pairs: a ninth of these, in which "
        "any two levels meet",
    )
    add(
        "--contestants",
        nargs="+",
        default=["gmrf100"],
        metavar="NAME",
        help=f"of {', '.join([*CONTESTANTS, *PEERS])}; gmrf100,lc/effective_beams=8 is one, too",
    )
    add("--seeds", type=int, default=10, metavar="K")
    add("--first-seed", type=int, default=FIRST_SEED, metavar="N")
    add("--jobs", type=int, default=1, metavar="N", help="surveys at once")
    add("--no-runs", action="store_true", help="draw what rows.jsonl has, and run nothing")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
