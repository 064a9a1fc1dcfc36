"""The look of the benchmarks' figures: that of the report."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")

from matplotlib import pyplot as plt  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402

from rbpf_svgp_slam.evaluation.figure_style import STYLE, WIDTH_IN  # noqa: E402

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
RMSE_LABEL, ELBO_LABEL = "held-out RMSE (m)", "ELBO (nats per beam)"
#: The first steps are far below all that matters later.
LOWEST_ELBO = -6.0


def score_curves(
    curves: dict[str, dict[str, list[float]]], x_name: str, x_label: str, title: str
) -> Figure:
    """RMSE and ELBO side by side over curves[contestant][x_name]."""
    with plt.rc_context(STYLE):
        figure, panels = plt.subplots(1, 2, figsize=(WIDTH_IN, 0.4 * WIDTH_IN))
        figure.suptitle(title, fontsize=10)
        for axes, name, label in zip(panels, ("rmse_m", "elbo"), (RMSE_LABEL, ELBO_LABEL)):
            for contestant, curve in curves.items():
                style = {"label": LABELS[contestant], "color": COLOURS[contestant]}
                axes.plot(curve[x_name], curve[name], **style)
            axes.set(xlabel=x_label, ylabel=label)
        best = max(np.max(curve["elbo"]) for curve in curves.values())
        worst = min(np.min(curve["elbo"]) for curve in curves.values())
        panels[1].set_ylim(max(worst, LOWEST_ELBO), best + 0.1)
        panels[0].legend()
    return figure


def save(figure: Figure, path: Path) -> None:
    """Write a PNG and let go of the figure."""
    with plt.rc_context(STYLE):
        figure.savefig(path)
    plt.close(figure)
