"""Evaluation of a finished run: metrics, figures and the run folder. Needs no ROS."""

from .report import evaluate, write_report, write_run
from .run_files import RunFolderError, engine_predictor, load_run, load_terrain, load_tracks
from .summary import summarise
from .survey_run import GridMap, StoredMap, SurveyRun, TimeLapse, place_beams
from .trajectory import interpolate_poses, read_tum, write_tum

__all__ = [
    "GridMap",
    "RunFolderError",
    "StoredMap",
    "SurveyRun",
    "TimeLapse",
    "engine_predictor",
    "evaluate",
    "interpolate_poses",
    "load_run",
    "load_terrain",
    "load_tracks",
    "place_beams",
    "read_tum",
    "summarise",
    "write_report",
    "write_run",
    "write_tum",
]
