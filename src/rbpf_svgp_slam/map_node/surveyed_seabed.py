"""Where beams have fallen so far, as the core shows it."""

from __future__ import annotations

import numpy as np
import rospy
from scipy.ndimage import binary_closing, binary_dilation, generate_binary_structure
from sensor_msgs.msg import PointCloud2

from rbpf_svgp_slam.protocol import names
from rbpf_svgp_slam.protocol.clouds import cloud_xy

# A cell is surveyed if there is a beam in it or in one beside it, or if it lies in a gap of at most
# twice so many cells between such: in turns, and where pings are thinned, swaths' ends are apart.
CLOSED_CELLS = 2
_CROSS = generate_binary_structure(2, 1)
_SQUARE = generate_binary_structure(2, 2)


class SurveyedSeabed:
    """The cells of a grid near the beams of rbpf_core/bathymetry, which the estimate has placed.

    That is listened to only where it is wanted: it is a large message.
    """

    def __init__(self, points: np.ndarray, spacing_m: float) -> None:
        """points [n, 2]: centres of cells, frame map, m; spacing_m: of the cells."""
        self._spacing_m = spacing_m
        # An area narrower than the spacing has no points.
        first = points.min(axis=0) if len(points) else np.zeros(2)
        # The margin is for closing, which takes what is outside for not surveyed.
        self._low = first - (CLOSED_CELLS + 0.5) * spacing_m
        self._cells = tuple(self._cells_of(points).T)
        self._shape = tuple(axis.max(initial=0) + 1 + CLOSED_CELLS for axis in self._cells)
        self._subscriber: rospy.Subscriber | None = None
        self._beams: PointCloud2 | None = None

    def listen(self, wanted: bool) -> None:
        """Begin or cease to listen; what has been heard is forgotten with it."""
        if wanted and self._subscriber is None:
            self._subscriber = rospy.Subscriber(
                names.BATHYMETRY, PointCloud2, self._on_beams, queue_size=1
            )
        elif not wanted and self._subscriber is not None:
            self._subscriber.unregister()
            self._subscriber = self._beams = None

    @property
    def known(self) -> bool:
        """Some beams have been heard of."""
        return self._beams is not None

    def surveyed(self) -> np.ndarray:
        """Which points' cells are: [n] bool."""
        grid = np.zeros(self._shape, dtype=bool)
        beams = self._beams
        if beams is not None:
            cells = self._cells_of(cloud_xy(beams))
            within = ((cells >= 0) & (cells < self._shape)).all(axis=1)
            grid[tuple(cells[within].T)] = True
        near = binary_dilation(grid, _SQUARE)
        return binary_closing(near, _CROSS, iterations=CLOSED_CELLS)[self._cells]

    def _cells_of(self, points: np.ndarray) -> np.ndarray:
        return np.floor((points - self._low) / self._spacing_m).astype(int)

    def _on_beams(self, cloud: PointCloud2) -> None:
        if cloud.width:
            self._beams = cloud
