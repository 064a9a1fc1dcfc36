"""All numbers that an SVGP learns, as flat vectors with named views.

One vector makes an optimizer a handful of operations, whatever the number of parameters.
"""

from __future__ import annotations

import functools
import math

import numpy as np
import torch
from torch import Tensor

#: Smallest ℓ [m], o [m²] and σ² [m²]. The last is the default of GPyTorch's GaussianLikelihood,
#: a σ of 1 cm; the others only keep divisions by ℓ and √o finite.
FLOORS = (1e-6, 1e-6, 1e-4)
#: |R_ii| counts as no less than this in log|R_ii|. The smallest that data can ask for is about
#: σ·√(S/(N·o)): 2e-5 for 12 million beams of σ = 0.02 m over a relief of 5 m.
SMALLEST_R_II = 1e-6


class Model:
    """The parameters of the prior and of the noise, or a gradient with respect to them.

    flat     [2S + 4] everything, in the order of the views below
    Z        [S, 2]  inducing points, m
    raw      [3]     ℓ, o and σ² before the softplus that keeps them positive (as in GPyTorch)
    c        [1]     constant mean, m
    """

    def __init__(self, flat: Tensor) -> None:
        self.flat = flat
        Z, self.raw, self.c = flat.split([len(flat) - 4, 3, 1])
        self.Z = Z.view(-1, 2)

    @classmethod
    def zeros(cls, inducing_points: int, dtype: torch.dtype, device: torch.device) -> Model:
        """For S inducing points."""
        return cls(torch.zeros(2 * inducing_points + 4, dtype=dtype, device=device))

    def set_hyperparameters(
        self, lengthscale_m: float, outputscale_m2: float, noise_variance_m2: float
    ) -> None:
        """Set ℓ, o and σ² from their values, which have to be above their floors."""
        values = zip((lengthscale_m, outputscale_m2, noise_variance_m2), FLOORS)
        raw = [inverse_softplus(value - floor) for value, floor in values]
        self.raw.copy_(torch.tensor(raw, dtype=torch.float64))

    def hyperparameters(self) -> list[float]:
        """Return ℓ [m], o [m²] and σ² [m²], in double precision."""
        return [softplus(raw) + floor for raw, floor in zip(self.raw.tolist(), FLOORS)]

    def hyperparameter_slopes(self) -> list[float]:
        """Return ∂ℓ/∂raw, ∂o/∂raw and ∂σ²/∂raw: the logistic function of each raw value."""
        return [1.0 / (1.0 + math.exp(-raw)) for raw in self.raw.tolist()]


class Parameters(Model):
    """A `Model` together with a q(v) = N(m, R Rᵀ), for Adam, which learns all of them alike.

    flat     [S + S² + 2S + 4] everything: m, R, then the model's in their order
    m        [S]     mean of the whitened q(v)
    R        [S, S]  its factor, lower triangular, zero above the diagonal; the signs of the
                     diagonal are free, since only R Rᵀ and log|R_ii| have a meaning
    """

    def __init__(self, inducing_points: int, dtype: torch.dtype, device: torch.device) -> None:
        S = inducing_points
        flat = torch.zeros(S + S * S + 2 * S + 4, dtype=dtype, device=device)
        #: [S + S²] what belongs to q(v), and [2S + 4] what belongs to the prior and the noise.
        self.variational, self.model = flat.split([S + S * S, 2 * S + 4])
        super().__init__(self.model)
        self.flat = flat
        self.m = self.variational[:S]
        self.R = self.variational[S:].view(S, S)

    @property
    def trace(self) -> float:
        """tr Σ = tr R Rᵀ."""
        return sum_of_elements(self.R * self.R)

    @property
    def log_determinant(self) -> float:
        """log|Σ| = 2·Σ log|R_ii|."""
        return 2.0 * self.diagonal_of_R().double().abs().log().sum().item()

    def diagonal_of_R(self) -> Tensor:
        """R_ii [S], of either sign, but away from zero, where −log|R_ii| has its pole.

        Adam may step across the pole, which is harmless: only R Rᵀ matters. An element that happens
        to end on it would have a gradient without bounds, and at zero no sign to leave it by.
        """
        diagonal = self.R.diagonal()
        away = diagonal.abs().clamp_min_(SMALLEST_R_II)
        return torch.where(diagonal < 0.0, -away, away)

    @property
    def packed_size(self) -> int:
        """Numbers that `pack` returns: S + S(S + 1)/2 + 2S + 4."""
        return len(self.flat) - len(self.m) * (len(self.m) - 1) // 2

    def pack(self, vector: Tensor) -> np.ndarray:
        """Array [packed_size] of a vector like `flat`, less R's upper triangle."""
        return vector.cpu().numpy()[_packed_index(len(self.m))]

    def unpack(self, array: np.ndarray, vector: Tensor) -> None:
        """Fill a vector like `flat` from what `pack` returned."""
        full = np.zeros(len(vector), dtype=array.dtype)
        full[_packed_index(len(self.m))] = array
        vector.copy_(torch.from_numpy(full))


@functools.lru_cache(maxsize=1)
def _packed_index(S: int) -> np.ndarray:
    """Where in `flat` the numbers are that can differ from zero."""
    rows, columns = np.tril_indices(S)
    after = S + S * S + np.arange(2 * S + 4)
    return np.concatenate([np.arange(S), S + S * rows + columns, after])


def sum_of_elements(matrix: Tensor) -> float:
    """In double precision over the rows, where a difference may be left of it."""
    return matrix.sum(1).sum(dtype=torch.float64).item()


def softplus(x: float) -> float:
    """log(1 + exp(x)), without overflow."""
    return max(x, 0.0) + math.log1p(math.exp(-abs(x)))


def inverse_softplus(y: float) -> float:
    """x such that softplus(x) = y, for y > 0."""
    return y + math.log(-math.expm1(-y))
