"""The beams of a survey, and where each particle was when they were measured."""

from __future__ import annotations

import numpy as np

from rbpf_svgp_slam.run.planar_poses import wrapped
from rbpf_svgp_slam.run.survey_run import SurveyRun

_UPPER = np.triu_indices(3)


class Histories:
    """P pings, N beams, J particles. Poses x, y, yaw: m, rad, map frame."""

    def __init__(self, run: SurveyRun, particles: int) -> None:
        self.stamp_s = run.stamp_s
        self.levelled = run.levelled.astype(float)  # [N, 3]
        self.ping_of_beam = run.ping_of_beam
        self._first = np.searchsorted(run.ping_of_beam, np.arange(len(run.stamp_s) + 1))
        self.poses = np.zeros((len(run.stamp_s), particles, 3))  # [P, J, 3]
        self.weights = np.full(particles, 1.0 / particles)

    @property
    def particles(self) -> int:
        """J."""
        return len(self.weights)

    def beams_of(self, ping: int, at_most: int) -> np.ndarray:
        """Indices of the ping's beams; of more than so many every second, third, ... one."""
        first, last = self._first[ping : ping + 2]
        return np.arange(first, last, max(1, -(-(last - first) // at_most)))

    def placed(self, beams: np.ndarray) -> np.ndarray:
        """Positions [J, n, 2] of the beams [n] in each particle, m."""
        poses = self.poses[self.ping_of_beam[beams]].swapaxes(0, 1)
        return _placed(self.levelled[beams, :2], poses)

    def placed_by_mean(self, beams: np.ndarray) -> np.ndarray:
        """Positions [n, 2] of the beams [n] by the mean of the histories, m."""
        pings, of_beam = np.unique(self.ping_of_beam[beams], return_inverse=True)
        return _placed(self.levelled[beams, :2], self.mean(pings)[of_beam])

    def mean(self, pings: np.ndarray) -> np.ndarray:
        """Poses [p, 3] at the pings [p]: the particles' weighted mean."""
        return self.mean_and_covariance(pings)[0]

    def mean_and_covariance(self, pings: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Poses [p, 3] and the upper triangles [p, 6] of their covariances."""
        poses = self.poses[pings]
        off = poses - poses[:, :1]
        off[..., 2] = wrapped(off[..., 2])
        mean_off = np.einsum("j,pjk->pk", self.weights, off)
        off -= mean_off[:, None]
        covariance = np.einsum("j,pjk,pjl->pkl", self.weights, off, off)
        return poses[:, 0] + mean_off, covariance[:, _UPPER[0], _UPPER[1]]

    def resample(self, ancestors: np.ndarray, pings: int) -> None:
        """Let every particle have its ancestor's first so many poses; all weigh the same then."""
        self.poses[:pings] = self.poses[:pings, ancestors]
        self.weights[:] = 1.0 / self.particles


def moved(poses: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Return the poses [..., 3] after steps [..., 3] that are given in their own frames."""
    cos, sin = np.cos(poses[..., 2]), np.sin(poses[..., 2])
    forward, left, turn = np.moveaxis(steps, -1, 0)
    ahead = [cos * forward - sin * left, sin * forward + cos * left, turn]
    return poses + np.stack(np.broadcast_arrays(*ahead), axis=-1)


def _placed(levelled_m: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """Beams [n, 2] of pings at poses [..., n, 3]: [..., n, 2]."""
    level = np.concatenate([levelled_m, np.zeros((len(levelled_m), 1))], axis=1)
    return moved(poses, level)[..., :2]
