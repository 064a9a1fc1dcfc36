"""The SVGP against numbers of GPyTorch's, which bench/svgp/golden.py has written."""

from pathlib import Path

import numpy as np
import pytest
import torch
from svgp_reference import posterior

from rbpf_svgp_slam.svgp.kernels import KERNELS
from rbpf_svgp_slam.svgp.objective import Objective
from rbpf_svgp_slam.svgp.parameters import Parameters

DOUBLE = torch.float64
GOLDEN = dict(np.load(Path(__file__).with_name("data") / "gpytorch_golden.npz"))
# GPyTorch's distances come from |z|² + |x|² − 2·zᵀx: that of a point to itself is about 1e-8, the
# root of the unit of rounding, instead of 0, and a Matérn-1/2 correlation is off by as much. Its
# jitter of 1e-9 m² counts less: added to Kzz as ours, but constant in ∂o, and added to the latent
# variance too.
TOLERANCE = 1e-7

kernels = pytest.mark.parametrize("kernel", sorted(KERNELS))


def golden(kernel):
    """Arrays of one kernel by their name."""
    prefix = f"{kernel}/"
    return {k[len(prefix) :]: v for k, v in GOLDEN.items() if k.startswith(prefix)}


def parameters(case):
    """Ours, with the values of the case; and its jitter as a share of the outputscale."""
    theta = Parameters(len(case["m"]), DOUBLE, "cpu")
    for name in ("m", "R", "Z"):
        getattr(theta, name).copy_(torch.from_numpy(case[name]))
    theta.c.fill_(case["c"].item())
    values = (case[name].item() for name in ("lengthscale", "outputscale", "noise"))
    theta.set_hyperparameters(*values)
    return theta, GOLDEN["jitter_m2"].item() / case["outputscale"].item()


@kernels
def test_elbo_and_gradients_are_gpytorchs(kernel):
    case = golden(kernel)
    theta, jitter = parameters(case)
    X, y = torch.from_numpy(case["X"]), torch.from_numpy(case["y"])
    objective = Objective(len(theta.m), len(y), kernel, jitter, DOUBLE, "cpu")
    gradient = Parameters(len(theta.m), DOUBLE, "cpu")
    value = objective.evaluate(theta, X, y, case["N"].item(), gradient)

    assert value == pytest.approx(case["elbo"].item(), rel=TOLERANCE)
    by_raw = gradient.raw.numpy() / theta.hyperparameter_slopes()
    ours = dict(zip(("d_lengthscale", "d_outputscale", "d_noise"), by_raw), d_c=gradient.c.numpy())
    ours.update(d_m=gradient.m.numpy(), d_R=gradient.R.numpy(), d_Z=gradient.Z.numpy())
    for name, values in ours.items():
        error = np.linalg.norm(values - case[name]) / np.linalg.norm(case[name])
        assert error < TOLERANCE, name


@kernels
def test_predictions_are_gpytorchs(kernel):
    case = golden(kernel)
    theta, jitter = parameters(case)
    points = torch.from_numpy(case["points"])
    mean, variance = posterior(theta, kernel, jitter).marginals(points)
    np.testing.assert_allclose(mean.numpy(), case["mean"], rtol=TOLERANCE, atol=TOLERANCE)
    np.testing.assert_allclose(variance.numpy(), case["variance"], rtol=TOLERANCE)
