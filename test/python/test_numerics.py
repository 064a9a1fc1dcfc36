"""Numbers that computing is not good at: coordinates of a projection, beams that say one thing."""

import numpy as np
import pytest
from made_up_survey import make_run, predict_seabed, without

from rbpf_svgp_slam.gmrf.gmrf_config import GmrfConfig
from rbpf_svgp_slam.gmrf.gmrf_group import GmrfGroup
from rbpf_svgp_slam.gmrf.survey_map import SurveyMap
from rbpf_svgp_slam.metrics.consistency import ConsistencySettings
from rbpf_svgp_slam.metrics.evaluation import evaluate
from rbpf_svgp_slam.run.survey_run import GridMap

FAR_M = np.array([1e7, -1e7])
TRACKS = ("estimate", "online", "dead_reckoning", "ground_truth")
BEAMS = 4000  # the first that a model is learned from


def far_away(run):
    """The same survey in coordinates of seven digits before the point."""
    tracks = {}
    for name in TRACKS:
        tracks[name] = getattr(run, name).copy()
        tracks[name][:, :2] += FAR_M

    def moved(grid):
        return GridMap(grid.x + FAR_M[0], grid.y + FAR_M[1], grid.mean, grid.variance)

    return without(
        run,
        **tracks,
        map=moved(run.map),
        terrain=moved(run.terrain),
        predict=lambda xy: predict_seabed(xy - FAR_M),
        support_points=run.support_points + [*FAR_M, 0.0],
    )


def test_a_survey_is_scored_alike_wherever_it_lies():
    near, far = (
        evaluate(run, ConsistencySettings()).report for run in (make_run(), far_away(make_run()))
    )
    numbers = {name: value for name, value in near.items() if isinstance(value, (int, float))}
    assert len(numbers) > 40
    for name, value in numbers.items():
        # single beams change their cells by rounding
        assert far[name] == pytest.approx(value, rel=1e-2, abs=1e-6), name


def beams_of(z):
    rng = np.random.default_rng(0)
    return np.column_stack([rng.uniform(0.0, 60.0, len(z)), rng.uniform(0.0, 40.0, len(z)), z])


ONE_THING = {
    "one place": np.tile([[1.0, 2.0, -30.0]], (BEAMS, 1)),
    "one depth": beams_of(np.full(BEAMS, -30.0)),
    "absurd outliers": beams_of(np.where(np.arange(BEAMS) % 50 == 0, 1e4, -30.0)),
}


@pytest.mark.parametrize("name", ONE_THING)
def test_a_model_is_learned_from_beams_that_say_one_thing(name):
    beams = ONE_THING[name]
    group = GmrfGroup(GmrfConfig())
    group.study(beams)
    learned, seabed = group.create().field.model, SurveyMap(beams, 1.0, np.zeros(2))
    for model in (learned, seabed.model):
        numbers = [model.spacing_m, model.lengthscale_m]
        numbers += [model.outputscale_m2, model.noise_variance_m2]
        assert np.isfinite(numbers).all() and min(numbers) > 0.0
    mean, variance = seabed.predict(beams[1:100, :2])
    np.testing.assert_allclose(mean, -30.0, atol=0.1)
    assert np.isfinite(variance).all() and variance.min() >= 0.0
