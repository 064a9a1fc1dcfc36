"""The command line of the benchmarks; started by tools/bench.sh."""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any, Iterator

from bench import section
from bench.paths import ROOT
from rbpf_svgp_slam import cpu, machine

#: Modules with run(out: Path) -> dict by the section's name. What they return goes into bench.json
#: under the name's first part.
SECTIONS = {
    "svgp.step": "bench.svgp.step",
    "svgp.time_to_rmse": "bench.svgp.time_to_rmse",
    "svgp.online": "bench.svgp.online",
    "svgp.lines": "bench.svgp.lines",
    "svgp.two_nodes": "bench.svgp.two_nodes",
    "svgp.scales": "bench.svgp.scales",
    "svgp.conditioning": "bench.svgp.conditioning",
    "svgp.common_random_numbers": "bench.svgp.common_random_numbers",
    "svgp.streaming": "bench.svgp.streaming",
    "gmrf.accuracy": "bench.gmrf.accuracy",
    "gmrf.picture": "bench.gmrf.picture",
    "gmrf.filter": "bench.gmrf.filter",
    "smoothing.closures": "bench.smoothing.closures",
    "smoothing.defaults": "bench.smoothing.defaults",
    "core.log_and_histories": "bench.core.log_and_histories",
    "core.journal": "bench.core.journal",
    "core.ingest": "bench.core.ingest",
    "core.ingest_training": "bench.core.ingest_training",
    "core.weights_and_numbering": "bench.core.weights_and_numbering",
    "core.prompts": "bench.core.prompts",
    "core.following": "bench.core.following",
    "core.offline": "bench.core.offline",
    "core.scaling": "bench.core.scaling",
    "core.two_hosts": "bench.core.two_hosts",
}


def main() -> None:
    """Run the sections asked for and write bench.json and figures."""
    arguments = _parse()
    # what map nodes do at their start; by inheritance the same matrix kernels for all contestants
    cpu.prepare(threads=1)
    out = arguments.out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    file = out / "bench.json"
    # sections that are not run keep their earlier numbers
    results = json.loads(file.read_text()) if file.exists() else {}
    results["machine"] = machine.describe()
    for name in arguments.only:
        print(f"== {name}", flush=True)
        started_s = time.monotonic()
        figures = section.run(SECTIONS[name], out)
        group = results.setdefault(name.partition(".")[0], {})
        group.update(figures)
        group.setdefault("wall_s", {})[name] = round(time.monotonic() - started_s, 1)
        file.write_text(json.dumps(results, indent=2) + "\n")
    _print_table(results)
    print(file)


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="tools/bench.sh", description=__doc__)
    parser.add_argument("out", nargs="?", type=Path, default=ROOT / "out" / "bench")
    parser.add_argument(
        "--only", nargs="+", choices=SECTIONS, default=list(SECTIONS), metavar="SECTION"
    )
    return parser.parse_args()


def _print_table(results: dict[str, Any]) -> None:
    """Every number, under its full name."""
    rows = list(_numbers(results))
    width = max((len(name) for name, _ in rows), default=0)
    for name, value in rows:
        shown = f"{value:.4g}" if isinstance(value, float) else value
        print(f"{name:{width}s}  {shown}")


def _numbers(tree: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Names and values of all leaves but lists."""
    for name, value in tree.items():
        if isinstance(value, dict):
            yield from _numbers(value, f"{prefix}{name}.")
        elif not isinstance(value, list):
            yield prefix + name, value


if __name__ == "__main__":
    main()
