"""Real files of echosounders, mapped: the table and the charts of docs/real_files.md.

Each goes the way of docs/your_survey.md: import, check, and an offline replay that maps alone, once
for each size of cells.
"""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
import yaml

from bench.paths import ROOT
from bench.svgp.in_process import markdown
from rbpf_svgp_slam.evaluation.numbers import fixed
from rbpf_svgp_slam.figures.chart_figures import depth_chart
from rbpf_svgp_slam.figures.figure_style import STYLE
from rbpf_svgp_slam.metrics.evaluation import evaluate
from rbpf_svgp_slam.metrics.map_metrics import grid_prediction, rmse
from rbpf_svgp_slam.run.run_files import load_run
from rbpf_svgp_slam.run.survey_run import SurveyRun

DATA = ROOT.parent / "shared" / "data"
#: The default, and one that suits beams a decimetre or two apart.
CELLS_M = (1.0, 0.25)
DOTS_PER_INCH = 80


@dataclass(frozen=True)
class RealFile:
    """A file, and what of it is known better than the file says."""

    name: str
    sonar: str
    options: tuple[str, ...] = ()


FILES = (
    # Its lever arms do not belong to its positions: docs/your_survey.md.
    RealFile("r2sonic2026.xtf", "R2Sonic 2026", ("--sonar", "0", "1.219", "3.38")),
    RealFile("em710.all", "Kongsberg EM 710"),
    RealFile("em2040.kmall", "Kongsberg EM 2040P"),
)


def main(data: str = str(DATA), out: str = str(ROOT / "out" / "real_files")) -> int | str:
    """Map every file and print the table; returns what sys.exit() takes."""
    files = [Path(data) / file.name for file in FILES]
    missing = [str(path) for path in files if not path.is_file()]
    if missing:
        return f"real_files: no {', '.join(missing)}; expected the files of docs/real_files.md"
    rows = []
    for file, path in zip(FILES, files):
        bag = import_file(file, path, Path(out).resolve() / path.stem)
        rows += [row(file, cells_m, map_bag(bag, cells_m)) for cells_m in CELLS_M]
    print(markdown(rows))
    return 0


def import_file(file: RealFile, path: Path, folder: Path) -> Path:
    """Import and check a file; returns the bag, which has its overlay beside it."""
    folder.mkdir(parents=True, exist_ok=True)
    bag = folder / "survey.bag"
    run_logged(["import_survey.py", path, *file.options, "--out", bag], folder / "import.txt")
    run_logged(["check_bag.py", bag, overlay_of(bag)], folder / "check.txt")
    return bag


def overlay_of(bag: Path) -> Path:
    """Where import_survey.py writes it."""
    return bag.with_suffix(".survey.yaml")


def map_bag(bag: Path, cells_m: float) -> SurveyRun:
    """Map a bag with cells of a size, and draw its chart; returns the run."""
    folder = bag.parent / f"cells_{cells_m:g}_m"
    folder.mkdir(exist_ok=True)
    overlay = yaml.safe_load(overlay_of(bag).read_text())
    # By the second the published map is masked.
    overlay.update(map={"resolution_m": cells_m}, output={"bathymetry_voxel_m": cells_m})
    (folder / "survey.yaml").write_text(yaml.safe_dump(overlay))
    mapping = ROOT / "config" / "mapping.yaml"
    launch = ["run_launch.py", "offline.launch", f"bag:={bag}", f"config:={mapping}"]
    launch += [f"survey:={folder / 'survey.yaml'}", f"out:={folder}"]
    run_logged(launch, folder / "log.txt")
    run = load_run(folder)
    with matplotlib.rc_context(STYLE):
        figure, _ = depth_chart(run, evaluate(run))
        figure.savefig(folder / "chart.png", dpi=DOTS_PER_INCH, bbox_inches="tight")
    return run


def run_logged(script: list[str | Path], log: Path) -> None:
    """Run a script of the package; all that it prints goes to a file."""
    command = ["rosrun", "rbpf_svgp_slam", *map(str, script)]
    print(" ".join(command), flush=True)
    with log.open("w") as output:
        subprocess.run(command, check=True, stdout=output, stderr=subprocess.STDOUT)


def row(file: RealFile, cells_m: float, run: SurveyRun) -> dict[str, str]:
    """What docs/real_files.md tells of a file."""
    report = run.statistics
    held_out = run.held_out[run.ping_of_beam]
    at = run.beams[held_out].astype(float)
    off_m = at[:, 2] - grid_prediction(run.beams[~held_out], at[:, :2], cells_m)
    depths = [fixed(report[f"depth_{name}_m"], 1) for name in ("min", "max")]
    return {
        "file": f"`{file.name}`, {file.sonar}",
        "pings": f"{report['pings']:,}",
        "beams": f"{report['beams']:,}",
        "time (s)": fixed(report["duration_s"], 1),
        "cells (m)": f"{cells_m:g}",
        "area (m²)": f"{report['area_m2']:,.0f}",
        "depth (m)": " to ".join(depths),
        "seabed (m)": fixed(report["seabed_rmse_on_grid_beams_m"], 3),
        "grid of such cells (m)": fixed(rmse(off_m[np.isfinite(off_m)]), 3),
        "1 m grid (m)": fixed(report["grid_rmse_m"], 3),
        "best particle's map (m)": fixed(report["map_rmse_on_grid_beams_m"], 3),
    }


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
