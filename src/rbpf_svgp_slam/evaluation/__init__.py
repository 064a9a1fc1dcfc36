"""Evaluation of a finished run: metrics, figures and the run folder. Needs no ROS."""

from .report import evaluate, write_run
from .summary import summarise
from .survey_run import GridMap, SurveyRun
from .trajectory import interpolate_poses, read_tum, write_tum

__all__ = [
    "GridMap",
    "SurveyRun",
    "evaluate",
    "interpolate_poses",
    "read_tum",
    "summarise",
    "write_run",
    "write_tum",
]
