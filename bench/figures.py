"""The look of the benchmarks' figures: that of the report."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")

from matplotlib import pyplot as plt  # noqa: E402
from matplotlib.axis import Axis  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402
from matplotlib.ticker import FuncFormatter, LogLocator  # noqa: E402

from rbpf_svgp_slam.figures.figure_style import STYLE, WIDTH_IN  # noqa: E402

matplotlib.rcParams.update(STYLE)

LABELS = {
    "gpytorch_newest": "GPyTorch, Adam",
    "adam": "ours, Adam",
    "natgrad": "ours, natural gradient",
    "streaming": "ours, streaming",
}
#: Okabe and Ito's.
COLOURS = {
    "gpytorch_newest": "#D55E00",
    "adam": "#0072B2",
    "natgrad": "#009E73",
    "streaming": "#CC79A7",
}
#: Lines that mark a place.
GUIDE = {"color": "#888888", "linewidth": 0.8, "linestyle": "--"}
RMSE_LABEL, ELBO_LABEL = "held-out RMSE (m)", "ELBO (nats per beam)"
#: The first steps are far below all that matters later.
LOWEST_ELBO = -3.0


def score_curves(
    curves: dict[str, dict[str, list[float]]], x_name: str, x_label: str, title: str
) -> Figure:
    """RMSE and ELBO side by side over curves[contestant][x_name]."""
    figure, panels = plt.subplots(1, 2, figsize=(WIDTH_IN, 0.4 * WIDTH_IN))
    figure.suptitle(title, fontsize=10)
    for axes, name, label in zip(panels, ("rmse_m", "elbo"), (RMSE_LABEL, ELBO_LABEL)):
        for contestant, curve in curves.items():
            style = {"label": LABELS[contestant], "color": COLOURS[contestant]}
            axes.plot(curve[x_name], curve[name], **style)
        axes.set(xlabel=x_label, ylabel=label)
    panels[0].set_yscale("log")
    plain_numbers(panels[0].yaxis)
    best = max(np.max(curve["elbo"]) for curve in curves.values())
    worst = min(np.min(curve["elbo"]) for curve in curves.values())
    panels[1].set_ylim(max(worst, LOWEST_ELBO), best + 0.1)
    return figure


def plain_numbers(axis: Axis, places: tuple[float, ...] = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)) -> None:
    """Ticks of a logarithmic axis at these places of every decade, as plain numbers."""
    axis.set_major_locator(LogLocator(subs=places))
    axis.set_minor_locator(LogLocator(subs=()))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def save(figure: Figure, path: Path) -> None:
    """Write a PNG and let go of the figure."""
    figure.savefig(path)
    plt.close(figure)
