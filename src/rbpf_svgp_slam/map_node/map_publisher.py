"""Publishes the best particle's map, a piece of the work at a time."""

from __future__ import annotations

import time
from typing import Iterator

import numpy as np
import rospy
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from rbpf_svgp_slam.figures.cloud_colours import points_rgb
from rbpf_svgp_slam.map_node.depth_rank import depth_ranks, occupancy_grid
from rbpf_svgp_slam.map_node.map_store import MapStore
from rbpf_svgp_slam.map_node.surveyed_seabed import SurveyedSeabed
from rbpf_svgp_slam.msg import FilterStatus
from rbpf_svgp_slam.parameters.loading import NodeParameters
from rbpf_svgp_slam.protocol import names
from rbpf_svgp_slam.protocol.clouds import packed_rgb, point_cloud
from rbpf_svgp_slam.survey_area.grid import survey_grid
from rbpf_svgp_slam.survey_area.polygon import survey_origin

# Of the published map, whose grid is coarsened to that.
MAX_POINTS = 40000
# Points predicted between two training steps, which takes about as long as a step.
CHUNK_POINTS = 1000


class MapPublisher:
    """Topics of the best particle's map, from its node.

    map/mean, in the report's colours, and map/depth_rank are of the seabed surveyed so far: a map
    predicts depths beyond it too, which nobody has seen. map/variance is that of the whole survey
    area. To them come the map's support points.

    Works on the training thread, a moment between every two steps.
    """

    def __init__(self, store: MapStore, parameters: NodeParameters) -> None:
        self.follow(store)
        self._frame = parameters.frames.map
        self._period_s = parameters.map.publish_period_s
        self._origin = survey_origin(parameters.survey_area)
        self._points, self._spacing_m = survey_grid(
            parameters.survey_area, parameters.map.resolution_m, MAX_POINTS
        )
        self._seabed = SurveyedSeabed(self._points, self._spacing_m)
        self._mean, self._variance, self._support = (
            rospy.Publisher(name, PointCloud2, queue_size=1)
            for name in (names.MAP_MEAN, names.MAP_VARIANCE, names.MAP_SUPPORT_POINTS)
        )
        # Latched, as maps are that others plan on.
        self._rank = rospy.Publisher(names.MAP_DEPTH_RANK, OccupancyGrid, queue_size=1, latch=True)
        self._best_particle: int | None = None
        self._next_s = 0.0  # monotonic
        rospy.Subscriber(names.FILTER_STATUS, FilterStatus, self._on_status, queue_size=1)

    def follow(self, store: MapStore) -> None:
        """Publish this store's maps from now on."""
        self._store = store
        self._job: Iterator[None] | None = None

    def advance(self) -> None:
        """Do the next piece of a publication that is under way or due."""
        if self._job is None:
            if not self._due():
                return
            self._next_s = time.monotonic() + self._period_s
            self._job = self._publish(self._best_particle)
        if next(self._job, "done") == "done":
            self._job = None

    def _on_status(self, status: FilterStatus) -> None:
        self._best_particle = status.best_particle

    def _due(self) -> bool:
        ours = self._period_s > 0 and self._best_particle in self._store.own
        masked = ours and self._connections(self._mean, self._rank) > 0
        self._seabed.listen(masked)
        return (
            ours
            and time.monotonic() >= self._next_s
            and (self._connections(self._support) > 0 or self._grid_is_wanted())
            and (self._seabed.known or not masked)
        )

    def _grid_is_wanted(self) -> bool:
        wanted = self._connections(self._mean, self._variance, self._rank) > 0
        return wanted and len(self._points) > 0

    @staticmethod
    def _connections(*topics: rospy.Publisher) -> int:
        return sum(topic.get_num_connections() for topic in topics)

    def _publish(self, particle: int) -> Iterator[None]:
        """Predict a copy of the map over the grid, yielding after each chunk, and publish it."""
        header = Header(stamp=rospy.Time.now(), frame_id=self._frame)
        snapshot = self._store.snapshot(particle)
        support = np.asarray(snapshot.support_points())
        x, y, z = support[:, 0] + self._origin[0], support[:, 1] + self._origin[1], support[:, 2]
        self._support.publish(point_cloud(header, {"x": x, "y": y, "z": z}))
        yield
        mean, variance = np.empty((2, len(self._points)), dtype=np.float32)
        if self._grid_is_wanted():
            for first in range(0, len(self._points), CHUNK_POINTS):
                chunk = slice(first, first + CHUNK_POINTS)
                xy = (self._points[chunk] - self._origin).astype(np.float32)
                with self._store.exclusive():
                    mean[chunk], variance[chunk] = snapshot.predict(xy)
                yield
            points = np.column_stack([self._points, mean])
            std = np.sqrt(np.maximum(variance, 0.0))
            self._variance.publish(point_cloud(header, {**_columns(points), "std": std}))
            if self._seabed.known:
                self._publish_surveyed(header, points)

    def _publish_surveyed(self, header: Header, points: np.ndarray) -> None:
        """Of the map's points [n, 3] those where beams fell."""
        surveyed = self._seabed.surveyed()
        seen = points[surveyed]
        rgb = packed_rgb(points_rgb(seen))
        self._mean.publish(point_cloud(header, {**_columns(seen), "rgb": rgb}))
        ranks = depth_ranks(points[:, 2], surveyed)
        self._rank.publish(occupancy_grid(header, self._points, ranks, self._spacing_m))


def _columns(points: np.ndarray) -> dict[str, np.ndarray]:
    """Of points [n, 3]."""
    return dict(zip("xyz", points.T))
