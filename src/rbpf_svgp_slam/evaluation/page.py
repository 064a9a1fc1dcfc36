"""report.html: one self-contained page, figures embedded."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jinja2
import matplotlib
from matplotlib.figure import Figure

from . import map_figures, time_lapse_figures, track_figures, training_figures
from .figure_style import STYLE
from .survey_run import SurveyRun

if TYPE_CHECKING:
    from .report import Evaluation

_FOLDER = Path(__file__).parent
_FIGURES = (
    track_figures.trajectories,
    track_figures.position_errors,
    map_figures.raw_bathymetry,
    map_figures.posterior,
    map_figures.seabed_maps,
    map_figures.consistency_maps,
    map_figures.held_out_residuals,
    training_figures.elbo,
    time_lapse_figures.time_lapse,
    track_figures.filter_history,
)


def render(run: SurveyRun, evaluation: Evaluation) -> str:
    """Return the page's text. A figure that the run has no data for is left out."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_FOLDER),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters["number"] = format_number
    figures = [
        {"png": base64.b64encode(to_png(figure)).decode(), "caption": caption, "name": name}
        for name, figure, caption in draw_figures(run, evaluation)
    ]
    return environment.get_template("report.html.j2").render(
        report=evaluation.report,
        figures=figures,
        parameters=list(flatten(run.config)),
        inducing_points=len(run.inducing_points),
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


def format_number(value: Any) -> str:
    """Format a quantity for a reader: three significant digits, thousands apart, – for None."""
    if value is None:
        return "–"
    if isinstance(value, dict):
        return ", ".join(f"{key} {format_number(item)}" for key, item in value.items())
    if isinstance(value, (bool, str)):
        return str(value)
    if isinstance(value, int):
        return f"{value:,}".replace(",", "\u202f")
    return f"{value:,.0f}".replace(",", "\u202f") if abs(value) >= 1000 else f"{value:.3g}"


def flatten(config: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the parameters of nested groups as (slash/separated/name, value)."""
    for key, value in config.items():
        if isinstance(value, dict):
            yield from flatten(value, f"{prefix}{key}/")
        else:
            yield f"{prefix}{key}", value
