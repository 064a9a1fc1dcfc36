"""What the benchmarks compute by themselves."""

import io

import numpy as np
import pytest
import torch

from bench.svgp import channel, scores, surveys
from bench.svgp.time_to_rmse import time_to_stay_below


def test_messages_arrive_as_they_were_sent():
    stream = io.BytesIO()
    channel.send(stream, {"command": "train", "steps": 3, "xy": np.eye(2)})
    stream.seek(0)
    message = channel.receive(stream)
    assert (message["command"].item(), message["steps"].item()) == ("train", 3)
    np.testing.assert_array_equal(message["xy"], np.eye(2))
    assert channel.receive(stream) is None


@pytest.mark.parametrize("transposed", [False, True])
def test_kl_divergence_is_torchs(transposed):
    rng = np.random.default_rng(1)
    m, T = rng.standard_normal(5), np.tril(rng.standard_normal((5, 5)))
    covariance = T.T @ T if transposed else T @ T.T
    q = torch.distributions.MultivariateNormal(torch.tensor(m), torch.tensor(covariance))
    one = torch.eye(5, dtype=torch.float64)
    p = torch.distributions.MultivariateNormal(0.0 * one[0], one)
    expected = torch.distributions.kl_divergence(q, p).item()
    # torch factorises Σ anew
    assert scores._kl_divergence(m, T) == pytest.approx(expected, rel=1e-9)


def test_expected_log_likelihood_is_the_mean_over_the_latent():
    error_m, variance, noise = np.array([0.3, -0.8]), np.array([0.2, 0.05]), 0.1
    nodes, weights = np.polynomial.hermite_e.hermegauss(20)
    residual_m = error_m[:, None] + np.sqrt(variance)[:, None] * nodes
    log_density = -0.5 * (np.log(2 * np.pi * noise) + residual_m**2 / noise)
    expected = np.mean(log_density @ weights / weights.sum())
    # a quadratic: the quadrature is exact
    value = scores._expected_log_likelihood(error_m, variance, noise)
    assert value == pytest.approx(expected, rel=1e-12)


def test_the_error_has_to_stay_below():
    curve = {"training_s": [1.0, 2.0, 3.0, 4.0], "rmse_m": [0.5, 0.2, 0.4, 0.1]}
    assert time_to_stay_below(curve, 0.3) == 4.0
    assert time_to_stay_below(curve, 0.6) == 1.0
    assert time_to_stay_below(curve, 0.05) is None


def test_a_survey_covers_its_area_in_order():
    survey = surveys.run_survey(surveys.relief_that_turns_rough(1), 30_000, 1)
    training, held_out = survey.training, survey.held_out
    assert (len(training.xyz_m), len(held_out.xyz_m)) == (30_000, surveys.HELD_OUT)
    assert (np.diff(training.arrival_s) >= 0).all()
    assert len(training.until(surveys.DURATION_S)) == 30_000
    assert np.isfinite(training.xyz_m).all()
    cells, _, _ = np.histogram2d(*training.xyz_m[:, :2].T, bins=(20, 15))
    assert cells.min() > 0
    # the last line is above the border, where it is rougher
    start, end = (training.until(share * surveys.DURATION_S) for share in (0.2, 0.8))
    later = training.xyz_m[len(end) :]
    assert later[:, 2].std() > 1.2 * start[:, 2].std()
