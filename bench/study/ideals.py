"""What missions allow, without a run of anything: python3 -m bench.study.ideals MISSION SEED ...

A line for each seed: errors of dead reckoning, of the ideal filter and of the ideal smoother, m
(docs/closures.md), as the reports of runs on the same simulated survey have them.
"""

from __future__ import annotations

import argparse

from bench.smoothing.simulated_runs import as_run
from bench.svgp.in_process import markdown
from rbpf_svgp_slam.metrics.ideal_metrics import ideal_metrics
from rbpf_svgp_slam.metrics.trajectory_errors import ate_aligned_rmse, ate_rmse
from rbpf_svgp_slam.simulation.mission import get_mission
from rbpf_svgp_slam.simulation.simulation import simulate_survey


def main() -> None:
    """Print them."""
    parser = argparse.ArgumentParser(prog="python3 -m bench.study.ideals", description=__doc__)
    parser.add_argument("mission")
    parser.add_argument("seeds", type=int, nargs="+", metavar="SEED")
    parser.add_argument("--scale", type=float, default=1.0)
    arguments = parser.parse_args()
    rows = []
    for seed in arguments.seeds:
        run = as_run(simulate_survey(get_mission(arguments.mission, arguments.scale), seed, None))
        allowed = ideal_metrics(run, [])
        rows.append(
            {
                "seed": seed,
                "DR, m": ate_rmse(run.estimate, run.ground_truth),
                "DR aligned, m": ate_aligned_rmse(run.estimate, run.ground_truth),
                "ideal online, m": allowed["ideal_online_ate_rmse_m"],
                "ideal, m": allowed["ideal_ate_rmse_m"],
                "ideal aligned, m": allowed["ideal_ate_aligned_rmse_m"],
            }
        )
    print(markdown(rows))


if __name__ == "__main__":
    main()
