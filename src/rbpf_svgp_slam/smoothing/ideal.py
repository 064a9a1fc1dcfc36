"""The yardstick: what a survey's odometry and overlaps allow, whatever the method.

The smoother's own pose graph is given true relative poses, with an error of their own, between
places whose swaths overlap. What it makes of them no registration can better by much: the rest of
the error is the odometry's where nothing overlaps, and the start's heading.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rbpf_svgp_slam import _smoothing
from rbpf_svgp_slam.run.planar_poses import relative_pose
from rbpf_svgp_slam.run.survey_run import SurveyRun

#: Errors of the relative poses: x, y (m), yaw (rad).
ERROR = np.array([0.1, 0.1, 0.005])
#: Each node has relative poses to so many older ones, the nearest.
OLDER = 3
#: The graph is solved after so many nodes; in long surveys less often, so many times in all.
SOLVED_EVERY, MOST_SOLUTIONS = 5, 200
#: Of a swath's beams the share that lies within its half width; and of both half widths the share
#: within which two places see the same seabed. Both as the smoother has them.
WITHIN, NEAR = 0.9, 0.75
PLANAR = [0, 1, 5]


@dataclass(frozen=True)
class Ideal:
    """Tracks at K nodes of the survey. Poses: [x y z roll pitch yaw], m, rad, map frame."""

    stamp_s: np.ndarray  # [K]
    truth: np.ndarray  # [K, 6]
    smoothed: np.ndarray  # [K, 6] the ideal smoother: each pose from the whole survey
    online: np.ndarray  # [K, 6] the ideal filter: each pose from what came before it
    closures: int  # true relative poses that it was given


def ideal(run: SurveyRun, params: _smoothing.SmoothingParams, seed: int = 0) -> Ideal | None:
    """Return what the survey of a run allows; None where ground truth or beams are missing.

    seed: of the relative poses' errors. One draw of them may be a lucky one.
    """
    if run.ground_truth is None or not len(run.levelled):
        return None
    known = np.isfinite(run.dead_reckoning).all(axis=1) & np.isfinite(run.ground_truth).all(axis=1)
    pings = np.flatnonzero(known)
    if not len(pings):
        return None
    nodes = pings[_spaced(run.stamp_s[pings], params.registration.node_period_s)]
    stamp_s, truth = run.stamp_s[nodes], run.ground_truth[nodes]
    track = IdealTrack(
        params, stamp_s, run.dead_reckoning[nodes][:, PLANAR], truth[:, PLANAR], seed
    )
    closures = track.run(_half_widths(run, nodes))
    smoothed, online = run.dead_reckoning[nodes].copy(), run.dead_reckoning[nodes].copy()
    smoothed[:, PLANAR], online[:, PLANAR] = track.smoothed, track.online
    return Ideal(stamp_s, truth, smoothed, online, closures)


class IdealTrack:
    """A pose graph that grows node by node. K nodes; poses x, y, yaw [K, 3], m and rad."""

    def __init__(
        self,
        params: _smoothing.SmoothingParams,
        stamp_s: np.ndarray,
        dead_reckoning: np.ndarray,
        truth: np.ndarray,
        seed: int = 0,
    ) -> None:
        """stamp_s [K], increasing; seed: of the relative poses' errors."""
        self._min_apart_s = params.registration.min_apart_s
        self._stamp_s, self._truth = stamp_s, truth
        self._moved = relative_pose(dead_reckoning[:-1], dead_reckoning[1:])
        self._graph = _smoothing.PoseGraph(params, stamp_s[0], dead_reckoning[0])
        self._rng = np.random.default_rng(seed)
        #: Each node's pose when it came, and when the last one had come.
        self.online = dead_reckoning.copy()
        self.smoothed = dead_reckoning.copy()

    def run(self, half_width_m: np.ndarray) -> int:
        """Let the survey happen, with swaths of half widths [K]; return the number of closures."""
        every = max(SOLVED_EVERY, -(-len(self._stamp_s) // MOST_SOLUTIONS))
        closures = 0
        for j in range(1, len(self._stamp_s)):
            self._graph.add_node(self._stamp_s[j], self._moved[j - 1])
            self.online[j] = self._graph.pose(j)
            for k in self._older(j, half_width_m):
                self._close(k, j)
                closures += 1
            if j % every == 0:
                self._graph.solve()
        self._graph.solve()
        self.smoothed = self._graph.poses
        return closures

    def _older(self, j: int, half_width_m: np.ndarray) -> np.ndarray:
        """The nearest older nodes, of those that the smoother would register j to."""
        old = np.searchsorted(self._stamp_s, self._stamp_s[j] - self._min_apart_s, side="right")
        distance_m = np.hypot(*(self._truth[:old, :2] - self._truth[j, :2]).T)
        near = np.flatnonzero(distance_m < NEAR * (half_width_m[:old] + half_width_m[j]))
        return near[np.argsort(distance_m[near], kind="stable")][:OLDER]

    def _close(self, k: int, j: int) -> None:
        true = relative_pose(self._truth[[k]], self._truth[[j]])[0]
        error = ERROR * self._rng.standard_normal(3)
        self._graph.add_closure(int(k), j, true + error, np.diag(ERROR**2))


def _spaced(stamp_s: np.ndarray, period_s: float) -> np.ndarray:
    """Indices of the first ping, and of each that comes a period or more after the last of them."""
    chosen = [0]
    for i, now_s in enumerate(stamp_s):
        if now_s - stamp_s[chosen[-1]] >= period_s:
            chosen.append(i)
    return np.array(chosen)


def _half_widths(run: SurveyRun, nodes: np.ndarray) -> np.ndarray:
    """Of the swath [K], m, over the pings from each node to the next."""
    node_of_ping = np.searchsorted(nodes, np.arange(len(run.stamp_s)), side="right") - 1
    node_of_beam = node_of_ping[run.ping_of_beam]
    good = (node_of_beam >= 0) & np.isfinite(run.levelled[:, 1])
    across_m = np.abs(run.levelled[good, 1])
    first = np.searchsorted(node_of_beam[good], np.arange(len(nodes) + 1))
    return np.array(
        [
            np.quantile(across_m[a:b], WITHIN) if b > a else 0.0
            for a, b in zip(first[:-1], first[1:])
        ]
    )
