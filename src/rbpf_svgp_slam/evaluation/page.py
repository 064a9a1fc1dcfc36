"""report.html: one self-contained page, figures embedded."""

from __future__ import annotations

import base64
from pathlib import Path

import jinja2

from rbpf_svgp_slam.evaluation.numbers import fixed, format_duration, format_number
from rbpf_svgp_slam.evaluation.survey_facts import caveats, order_rows, survey_facts
from rbpf_svgp_slam.figures.report_figures import draw_figures, to_png
from rbpf_svgp_slam.metrics.evaluation import Evaluation
from rbpf_svgp_slam.nested import flatten
from rbpf_svgp_slam.run.survey_run import SurveyRun

_FOLDER = Path(__file__).parent
# Figures that stand with the survey's facts; the others follow the tables.
_CHARTS = ("depth_chart", "survey_quality")


def render(run: SurveyRun, evaluation: Evaluation, with_figures: bool = True) -> str:
    """Return the page's text. A figure that the run has no data for is left out."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_FOLDER),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters["number"] = format_number
    environment.filters["fixed"] = fixed
    drawn = draw_figures(run, evaluation) if with_figures else ()
    figures = [
        {"png": base64.b64encode(to_png(figure)).decode(), "caption": caption, "name": name}
        for name, figure, caption in drawn
    ]
    charts = [figure for figure in figures if figure["name"] in _CHARTS]
    return environment.get_template("report.html.j2").render(
        report=evaluation.report,
        duration=format_duration(evaluation.report["duration_s"]),
        facts=survey_facts(evaluation.report),
        orders=order_rows(evaluation.report),
        caveats=caveats(run.estimate_covariance is not None),
        charts=charts,
        figures=[figure for figure in figures if figure not in charts],
        parameters=list(flatten(run.config)),
        support=f"{len(run.support_points)} {run.support_label}",
    )
