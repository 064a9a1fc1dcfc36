"""The figures of a report, in their order, and as PNG files."""

from __future__ import annotations

import io
from collections.abc import Iterator

import matplotlib
from matplotlib.figure import Figure

from rbpf_svgp_slam.figures import (
    chart_figures,
    closure_figures,
    error_figures,
    map_figures,
    time_lapse_figures,
    track_figures,
    training_figures,
)
from rbpf_svgp_slam.figures.figure_style import STYLE
from rbpf_svgp_slam.metrics.evaluation import Evaluation
from rbpf_svgp_slam.run.survey_run import SurveyRun

_FIGURES = (
    chart_figures.depth_chart,
    chart_figures.survey_quality,
    track_figures.trajectories,
    error_figures.position_errors,
    closure_figures.loop_closures,
    map_figures.raw_bathymetry,
    map_figures.posterior,
    map_figures.seabed_maps,
    map_figures.consistency_maps,
    map_figures.held_out_residuals,
    training_figures.elbo,
    time_lapse_figures.time_lapse,
    track_figures.filter_history,
)


def draw_figures(run: SurveyRun, evaluation: Evaluation) -> Iterator[tuple[str, Figure, str]]:
    """Yield the name, figure and caption of every figure that the run has data for."""
    with matplotlib.rc_context(STYLE):
        for draw in _FIGURES:
            drawn = draw(run, evaluation)
            if drawn is not None:
                yield draw.__name__, *drawn


def to_png(figure: Figure) -> bytes:
    """Return the figure as a PNG file's bytes."""
    buffer = io.BytesIO()
    # matplotlib makes ticks only now; tight, since equal axes rarely fill their figure.
    with matplotlib.rc_context(STYLE):
        figure.savefig(buffer, format="png", bbox_inches="tight", pad_inches=0.08)
    return buffer.getvalue()
