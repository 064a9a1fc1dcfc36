"""Submaps without particles, after Torroba et al. (2019): windows of dead reckoning, registered.

The engine is the package's own smoother (docs/closures.md), which gets no particle filter's word.
"""

from __future__ import annotations

import numpy as np

from bench.peers.histories import moved
from rbpf_svgp_slam import _smoothing
from rbpf_svgp_slam.parameters.known import default_parameters
from rbpf_svgp_slam.run.planar_poses import relative_pose
from rbpf_svgp_slam.run.survey_run import SurveyRun
from rbpf_svgp_slam.smoothing.smooth_run import PLANAR
from rbpf_svgp_slam.smoothing.smoothing_parameters import smoothing_params


def online_track(run: SurveyRun) -> np.ndarray:
    """Poses [P, 3] as they were known at each ping: the graph's newest one, and its odometry on.

    The graph is made as often as the package's own, smoothing/period_s.
    """
    dead_reckoning = run.dead_reckoning[:, PLANAR]
    smoother = _smoothing.Smoother(smoothing_params(run.config), run.stamp_s[0], dead_reckoning[0])
    beams_of_ping = np.bincount(run.ping_of_beam, minlength=len(run.stamp_s))
    first_beam = np.concatenate([[0], np.cumsum(beams_of_ping)])
    period_s = default_parameters()["smoothing"]["period_s"]
    period = ((run.stamp_s - run.stamp_s[0]) // period_s).astype(int)
    online, known, bias = dead_reckoning.copy(), dead_reckoning[0], np.zeros(5)
    step_s = np.diff(run.stamp_s)
    for number in np.unique(period):
        pings = np.flatnonzero(period == number)
        for ping in pings:
            if ping:
                step = relative_pose(dead_reckoning[[ping - 1]], dead_reckoning[[ping]])[0]
                known = moved(known, step - bias[:3] * step_s[ping - 1])
                known[:2] += bias[3:] * step_s[ping - 1]
            online[ping] = known
        beams = slice(first_beam[pings[0]], first_beam[pings[-1] + 1])
        smoother.add_pings(
            run.stamp_s[pings], dead_reckoning[pings], run.levelled[beams], beams_of_ping[pings]
        )
        smoother.update()
        known, bias = smoother.poses[-1], smoother.bias
    return online
