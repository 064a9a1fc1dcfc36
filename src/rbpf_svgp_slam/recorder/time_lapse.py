"""Keeps one particle's map as it grows, for the report."""

from __future__ import annotations

import numpy as np
import rospy

from rbpf_svgp_slam.maps import load_map
from rbpf_svgp_slam.msg import FilterStatus
from rbpf_svgp_slam.parameters.loading import NodeParameters
from rbpf_svgp_slam.recorder.survey_client import fetch_map
from rbpf_svgp_slam.run.survey_run import TimeLapse
from rbpf_svgp_slam.srv import GetMapsRequest
from rbpf_svgp_slam.survey_area.grid import cell_centres, grid_points
from rbpf_svgp_slam.survey_area.polygon import inside, survey_origin

MAX_FRAMES = 48
# A frame costs its node the time of a copy, and the recorder a prediction of so many cells.
MAX_CELLS = 10_000
ERROR_PERIOD_S = 60.0


class TimeLapseRecorder:
    """The best particle's map, every so often.

    Nobody knows how long a survey will be: when there are too many frames, every second one is
    dropped, and from then on they are taken half as often.
    """

    def __init__(self, parameters: NodeParameters) -> None:
        self._engine = parameters.map.engine
        self._period_s = parameters.output.time_lapse_period_s
        self._next_s = -np.inf  # stamp from which on a frame is due
        self._frames: list[tuple[float, np.ndarray]] = []  # stamp, mean [nx, ny]
        area = np.asarray(parameters.survey_area, dtype=float)
        resolution_m = max(
            parameters.map.resolution_m,
            float(np.sqrt(np.prod(np.ptp(area, axis=0)) / MAX_CELLS)),
        )
        self._origin_m = survey_origin(area)
        self._x, self._y = cell_centres(area, resolution_m)
        points = grid_points(self._x, self._y)
        self._inside = inside(points, area)
        self._points = (points[self._inside] - self._origin_m).astype(np.float32)

    def advance(self, status: FilterStatus) -> None:
        """Take a frame if one is due."""
        stamp_s = status.header.stamp.to_sec()
        if not self._period_s or not status.beams or stamp_s < self._next_s:
            return
        self._next_s = stamp_s + self._period_s
        try:
            self._frames.append((stamp_s, self._frame(status)))
        except (RuntimeError, ValueError, rospy.ServiceException) as error:
            rospy.logwarn_throttle(ERROR_PERIOD_S, f"no frame of the time lapse: {error}")
            return
        if len(self._frames) > MAX_FRAMES:
            del self._frames[1::2]
            self._period_s *= 2.0

    def _frame(self, status: FilterStatus) -> np.ndarray:
        """The map's mean on the grid."""
        # Its epoch may have gone on since that status.
        epoch = GetMapsRequest.ANY_EPOCH
        data = fetch_map(status.best_particle, epoch, status.particles, status.nodes)
        engine = load_map(self._engine, data)
        mean = np.full(len(self._inside), np.nan, dtype=np.float32)
        mean[self._inside], _ = engine.predict(self._points)
        return mean.reshape(len(self._x), len(self._y))

    def frames(self) -> TimeLapse | None:
        """All that have been kept; none if there are none."""
        if not self._frames:
            return None
        stamps_s, means = zip(*self._frames)
        return TimeLapse(np.array(stamps_s), self._x, self._y, np.array(means))
