"""The reference: the same model as GPyTorch's documentation builds it, trained by torch's Adam."""

from __future__ import annotations

import gpytorch
import numpy as np
import torch
from gpytorch.kernels import MaternKernel, ScaleKernel
from gpytorch.variational import CholeskyVariationalDistribution, VariationalStrategy

#: ν of the Matérn kernel by this package's name for it.
NU = {"matern12": 0.5, "matern32": 1.5, "matern52": 2.5}


class Model(gpytorch.models.ApproximateGP):
    """A whitened SVGP with a full Cholesky factor, constant mean and scaled Matérn kernel."""

    def __init__(self, Z: torch.Tensor, nu: float, jitter: float | None = None) -> None:
        strategy = VariationalStrategy(
            self,
            Z,
            CholeskyVariationalDistribution(len(Z)),
            learn_inducing_locations=True,
            jitter_val=jitter,
        )
        # q(v) starts as its prior, exactly as ours, instead of a noisy copy of it
        strategy.variational_params_initialized.fill_(1)
        super().__init__(strategy)
        self.mean_module = gpytorch.means.ConstantMean()
        self.covar_module = ScaleKernel(MaternKernel(nu=nu))

    def forward(self, x: torch.Tensor) -> gpytorch.distributions.MultivariateNormal:
        return gpytorch.distributions.MultivariateNormal(self.mean_module(x), self.covar_module(x))

    def set_hyperparameters(self, lengthscale_m: float, outputscale_m2: float) -> None:
        self.covar_module.base_kernel.lengthscale = lengthscale_m
        self.covar_module.outputscale = outputscale_m2


class GpytorchMap:
    """What a benchmark asks of a map: train_step, predict and a look at the parameters."""

    def __init__(
        self,
        Z: np.ndarray,
        lengthscale_m: float,
        outputscale_m2: float,
        noise_std_m: float,
        learning_rate: float,
    ) -> None:
        """Z [S, 2], m; the rest are initial values and Adam's learning rate."""
        self._model = Model(torch.from_numpy(Z.astype(np.float32)), NU["matern12"])
        self._model.set_hyperparameters(lengthscale_m, outputscale_m2)
        self._likelihood = gpytorch.likelihoods.GaussianLikelihood()
        self._likelihood.noise = noise_std_m**2
        self._elbo = gpytorch.mlls.VariationalELBO(self._likelihood, self._model, num_data=1)
        parameters = [*self._model.parameters(), *self._likelihood.parameters()]
        self._adam = torch.optim.Adam(parameters, lr=learning_rate)
        self._reference_m = None
        # Flush denormals, as ours does: CPUs are slow on them
        torch.set_flush_denormal(True)

    def train_step(self, beams: np.ndarray, beams_in_log: int) -> None:
        """One step on beams [M, 3] (x, y, z), drawn from a log that holds N of them now."""
        if self._reference_m is None:
            self._reference_m = float(beams[:, 2].mean())
        X = torch.from_numpy(np.ascontiguousarray(beams[:, :2]))
        y = torch.from_numpy(beams[:, 2] - np.float32(self._reference_m))
        self._model.train()
        self._elbo.num_data = beams_in_log
        self._adam.zero_grad()
        loss = -self._elbo(self._model(X), y)
        loss.backward()
        self._adam.step()

    @torch.no_grad()
    def predict(self, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean [n], m, and variance [n], m², of the latent seabed at [n, 2]."""
        self._model.eval()
        chunks = torch.from_numpy(np.ascontiguousarray(xy, dtype=np.float32)).split(2000)
        marginals = [self._model(X) for X in chunks]
        mean = np.concatenate([f.mean.numpy() for f in marginals]).astype(float)
        variance = np.concatenate([f.variance.numpy() for f in marginals]).astype(float)
        return mean + (self._reference_m or 0.0), variance

    @torch.no_grad()
    def variational_parameters(self) -> tuple[np.ndarray, np.ndarray]:
        """m [S] and R [S, S] of the whitened q(v) = N(m, R Rᵀ), R lower triangular."""
        distribution = self._model.variational_strategy._variational_distribution
        m, R = distribution.variational_mean, distribution.chol_variational_covar
        return m.numpy().astype(float), R.tril().numpy().astype(float)

    @property
    def noise_variance_m2(self) -> float:
        return self._likelihood.noise.item()
