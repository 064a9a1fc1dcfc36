"""Writes numbers of GPyTorch's that the package's tests compare ours with.

    PYTHON -m bench.svgp.golden test/python/data/gpytorch_golden.npz

PYTHON is that of a virtual environment of tools/setup.sh --bench; both give the same numbers.
"""

from __future__ import annotations

import sys

import gpytorch
import numpy as np
import torch

from bench.svgp.gpytorch_map import NU, Model

S, M, POINTS = 12, 30, 20
EXTENT_M = 10.0
#: GPyTorch adds it to Kzz whatever the outputscale, and once more to the latent variance.
JITTER_M2 = 1e-9


def main() -> None:
    """Write one group of arrays for each kernel."""
    torch.set_default_dtype(torch.float64)
    arrays = {"jitter_m2": np.array(JITTER_M2)}
    for seed, kernel in enumerate(sorted(NU)):
        case = _inputs(np.random.default_rng(seed))
        case.update(_outputs(kernel, case))
        arrays.update({f"{kernel}/{name}": np.asarray(value) for name, value in case.items()})
    np.savez_compressed(sys.argv[1], **arrays)


def _inputs(rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Parameters of a half-trained map, beams X [M, 2] and y [M], and points to predict at."""
    R = np.tril(0.1 * rng.standard_normal((S, S)))
    # the diagonal's signs are free: Adam may take it across zero
    np.fill_diagonal(R, rng.choice([-1.0, 1.0], S) * rng.uniform(0.2, 1.2, S))
    return {
        "m": rng.standard_normal(S),
        "R": R,
        "Z": rng.uniform(0.0, EXTENT_M, (S, 2)),
        "lengthscale": rng.uniform(2.0, 5.0),
        "outputscale": rng.uniform(0.5, 3.0),
        "noise": rng.uniform(0.05, 0.5),
        "c": rng.standard_normal(),
        "X": rng.uniform(0.0, EXTENT_M, (M, 2)),
        "y": rng.standard_normal(M),
        "N": rng.integers(1000, 100_000),
        "points": rng.uniform(-1.0, EXTENT_M + 1.0, (POINTS, 2)),
    }


def _outputs(kernel: str, case: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """ELBO/N, its gradients, and the latent marginals at the points."""
    model, likelihood = _model(kernel, case)
    X, y, points = (torch.as_tensor(case[name]) for name in ("X", "y", "points"))
    elbo = gpytorch.mlls.VariationalELBO(likelihood, model, num_data=int(case["N"]))
    model.train()
    value = elbo(model(X), y)
    value.backward()
    model.eval()
    with torch.no_grad():
        marginals = model(points)
        mean, variance = marginals.mean.numpy(), marginals.variance.numpy()
    gradients = _gradients(model, likelihood)
    return {"elbo": value.item(), "mean": mean, "variance": variance, **gradients}


def _model(kernel: str, case: dict[str, np.ndarray]) -> tuple[Model, torch.nn.Module]:
    model = Model(torch.from_numpy(case["Z"]), NU[kernel], JITTER_M2)
    model.set_hyperparameters(case["lengthscale"], case["outputscale"])
    q = model.variational_strategy._variational_distribution
    q.variational_mean.data.copy_(torch.from_numpy(case["m"]))
    q.chol_variational_covar.data.copy_(torch.from_numpy(case["R"]))
    model.mean_module.initialize(constant=float(case["c"]))
    likelihood = gpytorch.likelihoods.GaussianLikelihood()
    likelihood.noise = float(case["noise"])
    return model, likelihood


def _gradients(model: Model, likelihood: torch.nn.Module) -> dict[str, np.ndarray]:
    """By m, R and Z, and by the values of ℓ, o, σ² and c."""
    q = model.variational_strategy._variational_distribution
    kernel, noise = model.covar_module, likelihood.noise_covar
    raw = {
        "lengthscale": kernel.base_kernel.raw_lengthscale,
        "outputscale": kernel.raw_outputscale,
        "noise": noise.raw_noise,
    }
    gradients = {
        "d_m": q.variational_mean.grad,
        "d_R": q.chol_variational_covar.grad.tril(),
        "d_Z": model.variational_strategy.inducing_points.grad,
        "d_c": next(model.mean_module.parameters()).grad.sum(),
    }
    for name, parameter in raw.items():
        # softplus' slope leads from the raw parameter to the value
        gradients[f"d_{name}"] = (parameter.grad / torch.sigmoid(parameter.detach())).sum()
    return {name: gradient.detach().numpy() for name, gradient in gradients.items()}


if __name__ == "__main__":
    main()
