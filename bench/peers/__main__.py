"""python3 -m bench.peers NAME CASE SEED DIR: one peer on one survey; writes DIR/report.json."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from bench.peers.peer_runs import peer_run, report, write_tracks
from bench.smoothing.simulated_runs import as_run
from bench.study.cases import cases


def main(name: str, case: str, seed: str, folder: str) -> None:
    """Run it and write report and tracks."""
    survey = cases([case])[0].survey(int(seed))
    run = peer_run(name, as_run(survey), int(seed))
    write_tracks(run, Path(folder))
    text = json.dumps(report(run), indent=2)
    (Path(folder) / "report.json").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
