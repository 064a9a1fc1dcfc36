"""How much relief the study's seabeds have: python3 -m bench.study.relief [SEED].

Of the means on 1 m cells that the survey of the base sees, about their plane: the range of
95 %, and the standard deviation.
"""

from __future__ import annotations

import sys

import numpy as np

from bench.smoothing.simulated_runs import as_run
from bench.study.cases import BASE_SCALE, SEABEDS, Case
from bench.svgp.in_process import markdown


def relief_m(beams: np.ndarray) -> tuple[float, float]:
    """Range of 95 % and standard deviation, m, of what beams [n, 3] see."""
    cells, of = np.unique(np.floor(beams[:, :2]).astype(int), axis=0, return_inverse=True)
    depth_m = np.bincount(of.ravel(), beams[:, 2]) / np.bincount(of.ravel())
    plane = np.column_stack([cells, np.ones(len(cells))])
    about_m = depth_m - plane @ np.linalg.lstsq(plane, depth_m, rcond=None)[0]
    low_m, high_m = np.quantile(about_m, [0.025, 0.975])
    return float(high_m - low_m), float(about_m.std())


def main() -> None:
    """Print them."""
    seed = int(sys.argv[1]) if len(sys.argv) > 1 else 201
    rows = []
    for seabed in SEABEDS:
        run = as_run(Case(seabed).survey(seed, BASE_SCALE))
        range_m, std_m = relief_m(run.beams_ground_truth)
        rows.append({"seabed": seabed, "95 % within, m": range_m, "standard deviation, m": std_m})
    print(markdown(rows))


if __name__ == "__main__":
    main()
