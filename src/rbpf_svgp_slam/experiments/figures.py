"""Figures of an experiment, as PNG files for its summary and the documentation."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from rbpf_svgp_slam.experiments.plan import Experiment
from rbpf_svgp_slam.experiments.resources import Usage
from rbpf_svgp_slam.experiments.summary import Row, title
from rbpf_svgp_slam.figures import figure_style as style
from rbpf_svgp_slam.figures.report_figures import draw_figures, to_png
from rbpf_svgp_slam.figures.track_figures import trajectories
from rbpf_svgp_slam.figures.training_figures import objective_curves
from rbpf_svgp_slam.metrics.evaluation import Evaluation, evaluate
from rbpf_svgp_slam.run.run_files import load_run
from rbpf_svgp_slam.run.survey_run import SurveyRun
from rbpf_svgp_slam.simulation.mission import get_mission, plan_waypoints


def draw_experiment(plan: Experiment, rows: list[Row], out_dir: Path) -> list[Path]:
    """Write out_dir/figures/*.png: those of the shown run's report, and those of all runs."""
    folder = out_dir / "figures"
    folder.mkdir(exist_ok=True)
    shown = next((row for row in rows if row.folder.name == plan.figures_of), rows[-1])
    run = load_run(shown.folder)
    evaluation = evaluate(run)
    figures = {name: figure for name, figure, _ in draw_figures(run, evaluation)}
    figures["planned_and_estimated"] = _planned(plan, shown, run, evaluation)
    if len(rows) > 1:
        figures["objectives"] = _objectives(rows)
    if plan.live:
        figures["resources"] = resource_figure(shown.usage)
    paths = []
    for name, figure in figures.items():
        paths.append(folder / f"{name}.png")
        paths[-1].write_bytes(to_png(figure))
    lapse = shown.folder / "time_lapse.gif"
    if lapse.is_file():
        paths.append(folder / lapse.name)
        paths[-1].write_bytes(lapse.read_bytes())
    return paths


def _planned(plan: Experiment, row: Row, run: SurveyRun, evaluation: Evaluation) -> Figure:
    """The report's trajectories over the bathymetry, with the lines that were planned."""
    waypoints_m = plan_waypoints(get_mission(plan.mission, row.facts["settings"]["scale"]))
    with matplotlib.rc_context(style.STYLE):
        # The vehicle keeps to the plan: its true way would hide the lines.
        figure, _ = trajectories(dataclasses.replace(run, ground_truth=None), evaluation)
        axes = figure.axes[0]
        planned = {"color": "black", "linewidth": 0.9, "linestyle": (0, (5, 3)), "zorder": 5}
        axes.plot(*waypoints_m.T, label="planned", **planned)
        axes.set_title("Planned and estimated trajectories over the mean of the map")
        style.legend_below(axes)
    return figure


def _objectives(rows: list[Row]) -> Figure:
    """−ELBO of one particle's map in every run, over the survey."""
    curves = {}
    for row in rows:
        with np.load(row.folder / "history.npz") as history:
            t_s, elbo = history["t_s"], history["elbo"]
        curves[title(row)] = ((t_s - t_s[0]) / 60, -elbo)
    return objective_curves(curves)[0]


def resource_figure(usage: Usage) -> Figure:
    """Processors kept busy, stacked, and resident memory, by group of processes over wall time."""
    minutes = usage.wall_s / 60
    with matplotlib.rc_context(style.STYLE):
        figure = Figure(figsize=(style.WIDTH_IN, 5.0))
        busy, memory = figure.subplots(2, 1, sharex=True)
        order = sorted(usage.cores, key=lambda name: -usage.cores[name].mean())
        series = [smoothed(usage.cores[name]) for name in order]
        busy.stackplot(minutes, series, labels=order, linewidth=0)
        for name in order:
            memory.plot(minutes, usage.rss_mb[name] / 1000, label=name)
        busy.set(ylabel="cores busy", title="Processors and memory", ylim=(0, None))
        memory.set(xlabel="time (min)", ylabel="resident memory (GB)", ylim=(0, None))
        busy.legend(**{**style.LEGEND_ABOVE, "ncol": len(order)})
        figure.align_ylabels()
    return figure


def smoothed(values: np.ndarray, samples: int = 12) -> np.ndarray:
    """Running mean [K] over so many of the values [K], fewer at the ends."""
    window = np.ones(min(samples, len(values)))
    return np.convolve(values, window, "same") / np.convolve(np.ones(len(values)), window, "same")
