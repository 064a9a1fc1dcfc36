"""What an SVGP map asks of its optimizer, which owns all that is learned."""

from __future__ import annotations

import copy
import functools
import math
from abc import ABC, abstractmethod
from typing import Mapping

import numpy as np
import torch
from torch import Tensor

from rbpf_svgp_slam.svgp.config import SvgpConfig
from rbpf_svgp_slam.svgp.parameters import Model
from rbpf_svgp_slam.svgp.posterior import Gaussian
from rbpf_svgp_slam.svgp.prior import Prior


class NotFinite(ArithmeticError):
    """A step would have produced a value that is not finite."""


class Optimizer(ABC):
    """The model and q(v) of one map, and what is needed to improve them.

    Before the first step q(v) is the prior.
    """

    #: Name of each array of its state: kind of number, dimensions.
    ENTRIES: dict[str, tuple[str, int]]

    #: What depths count from, m; NaN before the first step.
    reference_m: float = math.nan
    #: How often the last step had to raise the jitter of the inducing points' covariance.
    jitter_raises: int = 0

    def __init__(self, config: SvgpConfig) -> None:
        self.config = config
        self.dtype = getattr(torch, config.dtype)
        self.device = torch.device(config.device)

    @property
    @abstractmethod
    def model(self) -> Model:
        """To be read; filled in by `start`."""

    @abstractmethod
    def start(self, Z: np.ndarray, lengthscale_m: float, pitch_m: float) -> None:
        """Set the initial model: inducing points Z [S, 2], m, ℓ, and their spacing, m."""

    @property
    def stamp(self) -> object:
        """Another object whenever the model may have been changed through another map."""
        return self

    @abstractmethod
    def gaussian(self) -> Gaussian:
        """q(v) as it stands."""

    def prior_inverse(self) -> Tensor:
        """L⁻¹ [S, S] of the model as it stands, not to be changed."""
        config, S = self.config, self.config.inducing_points
        return Prior(S, config.kernel, config.jitter, self.dtype, self.device).factorise(self.model)

    def copy(self) -> Optimizer:
        """One in the same state that goes on independently, but for what the maps share."""
        return copy.deepcopy(self, {id(one): one for one in self._shared()})

    def _shared(self) -> list[object]:
        """What copies have in common."""
        return [self.config]

    @abstractmethod
    def arrays(self) -> dict[str, np.ndarray]:
        """Its state, by the names in ENTRIES."""

    @abstractmethod
    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Take over what `arrays` returned; raises ValueError if it does not fit."""

    def restore_reference(self, reference_m: float) -> None:
        """Take over what the depths of a state that has been restored count from."""
        self.reference_m = reference_m

    def _start(self, model: Model, Z: np.ndarray, lengthscale_m: float) -> None:
        config = self.config
        model.Z.copy_(torch.from_numpy(Z))
        model.set_hyperparameters(lengthscale_m, config.outputscale_m2, config.noise_std_m**2)


class MinibatchOptimizer(Optimizer):
    """One that learns from minibatches."""

    @abstractmethod
    def step(self, X: Tensor, y: Tensor, N: int) -> float | None:
        """One step on X [M, 2], m, and y [M], m, of a log of N beams.

        Returns the ELBO per datum in nats, or none if this step did not need it. Raises
        `NotFinite` or `NotPositiveDefinite` and then leaves everything as it was.
        """


def checked(arrays: Mapping[str, np.ndarray], name: str, size: int) -> np.ndarray:
    """The array of that name, if it has `size` finite numbers."""
    array = arrays[name]
    if array.size != size or not np.isfinite(array).all():
        raise ValueError(f"map's {name} has {array.size} numbers; expected {size} finite")
    return array


def fill(arrays: Mapping[str, np.ndarray], **vectors: Tensor) -> None:
    """Each vector from the array of its name; raises ValueError where it does not fit."""
    for name, vector in vectors.items():
        vector.copy_(torch.from_numpy(checked(arrays, name, len(vector))))


def expect_squares(y: Tensor) -> None:
    """Raise `NotFinite` where the depths' squares are not: sums would be spoilt for good."""
    if not math.isfinite(torch.dot(y, y).item()):
        raise NotFinite(f"square of a depth of {y.abs().max().item():g} m is not finite")


def packed(symmetric: Tensor) -> np.ndarray:
    """Array [S(S + 1)/2] of a symmetric matrix [S, S], by rows up to the diagonal."""
    return symmetric.cpu().numpy()[_lower(len(symmetric))]


def unpack(array: np.ndarray, symmetric: Tensor) -> None:
    """Fill a matrix from what `packed` returned."""
    full = np.zeros(symmetric.shape)
    full[_lower(len(full))] = array
    symmetric.copy_(torch.from_numpy(full + np.tril(full, -1).T))


@functools.lru_cache(maxsize=1)
def _lower(S: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the lower triangle."""
    return np.tril_indices(S)
