"""How well some particles' maps predict held-out beams, beside the best particle's."""

from __future__ import annotations

from typing import Any

import numpy as np
import rospy

from rbpf_svgp_slam.maps import load_map
from rbpf_svgp_slam.metrics.map_metrics import predict_in_chunks, rmse
from rbpf_svgp_slam.msg import FilterStatus
from rbpf_svgp_slam.recorder.survey_client import fetch_map
from rbpf_svgp_slam.run.run_files import engine_predictor
from rbpf_svgp_slam.run.survey_run import SurveyRun

# A map's RMSE over so many beams has a standard error of half a percent; a map takes a third of a
# second.
MAPS, BEAMS = 10, 20_000


def sampled_map_rmse(run: SurveyRun, status: FilterStatus, epoch: int) -> dict[str, Any]:
    """Of up to 10 particles spread evenly over all: number of maps, mean and worst RMSE, m.

    All at the same held-out beams, placed with the estimate: where particles differ in their
    trajectories (SLAM), their maps are not expected to fit it equally well. epoch: of GetMaps.
    """
    held_out = np.flatnonzero(run.held_out[run.ping_of_beam])
    chosen = np.random.default_rng(0).permutation(held_out)[:BEAMS]
    beams = run.beams[chosen]
    particles = np.unique(np.linspace(0, status.particles - 1, MAPS).astype(int))
    errors = []
    for particle in particles:
        try:
            data = fetch_map(int(particle), epoch, status.particles, status.nodes)
        except (RuntimeError, rospy.ServiceException) as error:
            rospy.logwarn("The map of particle %d is not in the report: %s", particle, error)
            continue
        engine = load_map(run.stored_map.engine, data)
        predict = engine_predictor(engine, run.stored_map.origin_m)
        errors.append(rmse(beams[:, 2] - predict_in_chunks(predict, beams[:, :2])[0]))
    known = [error for error in errors if error is not None]
    if not known:
        return {"maps": 0, "mean": None, "worst": None}
    return {"maps": len(known), "mean": float(np.mean(known)), "worst": max(known)}
