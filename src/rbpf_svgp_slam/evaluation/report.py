"""Writes the report into the folder of a finished run: metrics, page, seabed and animation."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from rbpf_svgp_slam.evaluation import page
from rbpf_svgp_slam.figures.time_lapse_figures import GIF_NAME, write_time_lapse_gif
from rbpf_svgp_slam.metrics.consistency import ConsistencySettings
from rbpf_svgp_slam.metrics.evaluation import evaluate
from rbpf_svgp_slam.run.aside import written_aside
from rbpf_svgp_slam.run.run_files import SEABED, save_seabed
from rbpf_svgp_slam.run.survey_run import SurveyRun


def write_report(
    run: SurveyRun,
    out_dir: Path,
    settings: ConsistencySettings = ConsistencySettings(),
    figures: bool = True,
) -> dict[str, Any]:
    """Write the report's files into a run folder and return what report.json holds.

    These are report.json, report.html and, where the run has them, seabed.npz and time_lapse.gif.
    Without figures the page has none, and there is no time_lapse.gif.
    """
    evaluation = evaluate(run, settings)
    text = json.dumps(evaluation.report, indent=2, allow_nan=False)
    with written_aside(out_dir, (SEABED,)) as aside:
        (aside / "report.json").write_text(text + "\n", encoding="utf-8")
        save_seabed(run, aside)
    # Their figures take their time, and may fail: the numbers are there already.
    with written_aside(out_dir, (GIF_NAME,)) as aside:
        html = page.render(run, evaluation, figures)
        (aside / "report.html").write_text(html, encoding="utf-8")
        if figures:
            write_time_lapse_gif(run, aside)
    return evaluation.report
