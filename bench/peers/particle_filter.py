"""A plain Rao-Blackwellised particle filter: the package's motion and weights, a peer's maps."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from bench.peers.histories import Histories, moved
from bench.peers.weight_rule import Prediction, WeightRule, systematic
from rbpf_svgp_slam.parameters.known import default_parameters
from rbpf_svgp_slam.run.planar_poses import relative_pose
from rbpf_svgp_slam.run.survey_run import SurveyRun
from rbpf_svgp_slam.smoothing.smooth_run import PLANAR

#: Of a ping, those that vote.
VOTING_BEAMS = 60


class Maps(Protocol):
    """Those of all particles; they place beams by the histories that they were made with."""

    def learn(self, pings: np.ndarray) -> None:
        """Take in these pings, which have become old enough."""

    def predict(self, beams: np.ndarray) -> Prediction:
        """The depths of these beams, of the latest ping."""

    def resample(self, ancestors: np.ndarray) -> None:
        """Let every particle have its ancestor's map."""


class ParticleFilter:
    """One survey. Afterwards `histories` has the final estimate."""

    def __init__(
        self, run: SurveyRun, histories: Histories, maps: Maps, rng: np.random.Generator
    ) -> None:
        """run: its dead reckoning starts where the track does."""
        parameters = default_parameters()
        self._period_s = 1.0 / parameters["lc"]["rate_hz"]
        self._hold_back_s = parameters["mapping"]["hold_back_s"]
        self._rule = WeightRule.shipped()
        self._run, self.histories, self._maps, self._rng = run, histories, maps, rng
        self._pings_learned = 0
        pings = len(run.stamp_s)
        self.online, self.online_covariance = np.zeros((pings, 3)), np.zeros((pings, 6))
        self.prompts = self.resamplings = 0

    def run(self) -> None:
        """Let the survey happen."""
        stamp_s = self._run.stamp_s
        last_s = stamp_s[0]
        for ping, now_s in enumerate(stamp_s):
            self._move(ping)
            (
                self.online[[ping]],
                self.online_covariance[[ping]],
            ) = self.histories.mean_and_covariance(np.array([ping]))
            if now_s - last_s >= self._period_s:
                last_s = now_s
                self._learn(now_s)
                self._prompt(ping)

    def _move(self, ping: int) -> None:
        """Dead reckoning's step from the ping before, with the motion model's noise."""
        dead_reckoning, poses = self._run.dead_reckoning[:, PLANAR], self.histories.poses
        if ping == 0:
            poses[0] = dead_reckoning[0]
            return
        step = relative_pose(dead_reckoning[[ping - 1]], dead_reckoning[[ping]])
        motion = self._run.config["motion"]
        std = [motion[name] for name in ("surge_std_m", "sway_std_m", "yaw_std_rad")]
        of_step = np.sqrt(self._run.stamp_s[ping] - self._run.stamp_s[ping - 1]) * np.array(std)
        noise = of_step * self._rng.standard_normal(poses[ping].shape)
        poses[ping] = moved(poses[ping - 1], step + noise)

    def _learn(self, now_s: float) -> None:
        old = int(np.searchsorted(self._run.stamp_s, now_s - self._hold_back_s, side="right"))
        pings = np.arange(self._pings_learned, old)
        self._pings_learned = max(self._pings_learned, old)
        pings = pings[~self._run.held_out[pings]]
        if len(pings):
            self._maps.learn(pings)

    def _prompt(self, ping: int) -> None:
        histories = self.histories
        beams = histories.beams_of(ping, VOTING_BEAMS)
        if not len(beams):
            return
        prediction = self._maps.predict(beams)
        likelihood = self._rule.log_likelihood(histories.levelled[beams, 2], prediction)
        if likelihood is None:
            return
        self.prompts += 1
        histories.weights = self._rule.updated(histories.weights, likelihood)
        if self._rule.asks_for_resampling(histories.weights):
            ancestors = systematic(histories.weights, self._rng)
            histories.resample(ancestors, ping + 1)
            self._maps.resample(ancestors)
            self.resamplings += 1
