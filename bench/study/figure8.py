"""The paper's Fig. 8: python3 -m bench.study.figure8 PAPER OURS OUT.png.

PAPER and OURS are run folders of experiment.py exp3, by config/paper.yaml and by ours. Above the
tracks beside the true one, below their distance from it over time; with those of dead reckoning,
and of the ideal smoother and filter (docs/closures.md).
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from bench.figures import WIDTH_IN, plt
from rbpf_svgp_slam.figures import figure_style as style
from rbpf_svgp_slam.metrics.trajectory_errors import position_error
from rbpf_svgp_slam.run.run_files import load_run
from rbpf_svgp_slam.run.survey_run import SurveyRun
from rbpf_svgp_slam.smoothing.ideal import Ideal, ideal
from rbpf_svgp_slam.smoothing.smoothing_parameters import smoothing_params

#: Of the curves: label, colour, line style.
LOOK = {
    "dead reckoning": (style.COLOURS["dead_reckoning"], "-"),
    "the paper's rule": ("#CC79A7", "-"),
    "ours, online": (style.COLOURS["online"], "-"),
    "ideal filter": (style.COLOURS["online"], ":"),
    "ours": (style.COLOURS["estimate"], "-"),
    "ideal smoother": (style.COLOURS["estimate"], ":"),
}


def main() -> None:
    """Draw it."""
    parser = argparse.ArgumentParser(prog="python3 -m bench.study.figure8", description=__doc__)
    for name in ("paper", "ours", "out"):
        parser.add_argument(name, type=Path)
    arguments = parser.parse_args()
    paper, ours = load_run(arguments.paper), load_run(arguments.ours)
    allowed = ideal(ours, smoothing_params(ours.config))
    if paper.ground_truth is None or allowed is None:
        parser.error("a run has no ground truth; expected both to be simulated")
    figure, (tracks, errors) = plt.subplots(
        2, 1, figsize=(WIDTH_IN, 8.5), height_ratios=[1.5, 1.0], layout="constrained"
    )
    _draw_tracks(tracks, paper, ours)
    _draw_errors(errors, paper, ours, allowed)
    figure.savefig(arguments.out)


def _draw_tracks(axes: plt.Axes, paper: SurveyRun, ours: SurveyRun) -> None:
    axes.plot(*ours.ground_truth[:, :2].T, color="black", linewidth=0.8, label="ground truth")
    for label, poses in (
        ("dead reckoning", ours.dead_reckoning),
        ("the paper's rule", paper.estimate),
        ("ours", ours.estimate),
    ):
        colour, line = LOOK[label]
        axes.plot(*poses[:, :2].T, line, color=colour, linewidth=1.0, label=label)
    axes.set(xlabel="x (m)", ylabel="y (m)", title="Tracks", aspect="equal", adjustable="datalim")
    axes.legend(**style.LEGEND_ABOVE)


def _draw_errors(axes: plt.Axes, paper: SurveyRun, ours: SurveyRun, allowed: Ideal) -> None:
    def draw(label: str, stamp_s: np.ndarray, poses: np.ndarray, truth: np.ndarray) -> None:
        distance_m = np.linalg.norm(position_error(poses, truth)[:, :2], axis=1)
        rmse_m = np.sqrt(np.nanmean(distance_m**2))
        colour, line = LOOK[label]
        minutes = (stamp_s - ours.stamp_s[0]) / 60.0
        axes.plot(minutes, distance_m, line, color=colour, label=f"{label} ({rmse_m:.2f} m)")

    draw("dead reckoning", ours.stamp_s, ours.dead_reckoning, ours.ground_truth)
    draw("the paper's rule", paper.stamp_s, paper.estimate, paper.ground_truth)
    draw("ours, online", ours.stamp_s, ours.online, ours.ground_truth)
    draw("ideal filter", allowed.stamp_s, allowed.online, allowed.truth)
    draw("ours", ours.stamp_s, ours.estimate, ours.ground_truth)
    draw("ideal smoother", allowed.stamp_s, allowed.smoothed, allowed.truth)
    axes.set(xlabel="time (min)", ylabel="distance (m)", ylim=(0, None))
    axes.set_title("Position error (RMS of each)")
    axes.legend(loc="upper left", ncol=3)


if __name__ == "__main__":
    main()
