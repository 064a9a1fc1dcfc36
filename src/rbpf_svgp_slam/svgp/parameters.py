"""All numbers that an SVGP learns, as one flat vector with named views.

One vector makes the optimizer a handful of operations, whatever the number of parameters.
"""

import math

import torch

#: Floor of the noise variance, m²: the default constraint of GPyTorch's GaussianLikelihood.
NOISE_VARIANCE_FLOOR_M2 = 1e-4


class Parameters:
    """The SVGP's parameters, or a gradient with respect to them, for S inducing points.

    flat     [S + S² + 2S + 4] everything, in the order of the views below
    m        [S]     mean of the whitened q(v) = N(m, R Rᵀ)
    R        [S, S]  its factor, lower triangular, zero above the diagonal; the signs of the
                     diagonal are free, since only R Rᵀ and log|R_ii| have a meaning
    Z        [S, 2]  inducing points, m
    raw      [3]     ℓ, o and σ² before the softplus that keeps them positive (as in GPyTorch)
    c        [1]     constant mean, m
    """

    def __init__(self, inducing_points, dtype, device):
        S = inducing_points
        self.flat = torch.zeros(S + S * S + 2 * S + 4, dtype=dtype, device=device)
        m, R, Z, raw, c = self.flat.split([S, S * S, 2 * S, 3, 1])
        self.m, self.R, self.Z, self.raw, self.c = m, R.view(S, S), Z.view(S, 2), raw, c
        #: [S + S²] what belongs to q(v), and [2S + 4] what belongs to the prior and the noise.
        self.variational, self.model = self.flat.split([S + S * S, 2 * S + 4])

    def set_hyperparameters(self, lengthscale_m, outputscale_m2, noise_variance_m2):
        """Set ℓ, o and σ² from their values."""
        values = lengthscale_m, outputscale_m2, noise_variance_m2 - NOISE_VARIANCE_FLOOR_M2
        self.raw.copy_(torch.tensor([inverse_softplus(v) for v in values], dtype=torch.float64))

    def hyperparameters(self):
        """Return ℓ [m], o [m²] and σ² [m²], in double precision."""
        lengthscale, outputscale, noise = (softplus(v) for v in self.raw.tolist())
        return lengthscale, outputscale, noise + NOISE_VARIANCE_FLOOR_M2

    def hyperparameter_slopes(self):
        """Return ∂ℓ/∂raw, ∂o/∂raw and ∂σ²/∂raw: the logistic function of each raw value."""
        return [1.0 / (1.0 + math.exp(-v)) for v in self.raw.tolist()]


def softplus(x):
    """log(1 + exp(x)), without overflow."""
    return max(x, 0.0) + math.log1p(math.exp(-abs(x)))


def inverse_softplus(y):
    """x such that softplus(x) = y, for y > 0."""
    return y + math.log(-math.expm1(-y))
