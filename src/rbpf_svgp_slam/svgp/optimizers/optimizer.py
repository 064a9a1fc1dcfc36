"""What an SVGP map asks of its optimizer, which owns all that is learned."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Mapping

import numpy as np
import torch
from torch import Tensor

from rbpf_svgp_slam.svgp.config import SvgpConfig
from rbpf_svgp_slam.svgp.parameters import Model
from rbpf_svgp_slam.svgp.posterior import Gaussian


class NotFinite(ArithmeticError):
    """A step would have produced a value that is not finite."""


class Optimizer(ABC):
    """The model and q(v) of one map, and what is needed to improve them."""

    #: Name of each array of its state: kind of number, dimensions.
    ENTRIES: dict[str, tuple[str, int]]
    #: Spacing of the initial inducing points, m.
    pitch_m: float = 1.0

    model: Model
    #: How often the last step had to raise the jitter of the inducing points' covariance.
    jitter_raises: int = 0

    def __init__(self, config: SvgpConfig) -> None:
        """Before the first step q(v) is the prior; the model is to be filled in by the caller."""
        self.config = config
        self.dtype = getattr(torch, config.dtype)
        self.device = torch.device(config.device)

    @abstractmethod
    def step(self, X: Tensor, y: Tensor, N: int) -> float | None:
        """One step on X [M, 2], m, and y [M], m, of a log of N beams.

        Returns the ELBO per datum in nats, or none if this step did not need it. Raises
        `NotFinite` or `NotPositiveDefinite` and then leaves everything as it was.
        """

    @abstractmethod
    def gaussian(self) -> Gaussian:
        """q(v) as it stands."""

    @abstractmethod
    def arrays(self) -> dict[str, np.ndarray]:
        """Its state, by the names in ENTRIES."""

    @abstractmethod
    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Take over what `arrays` returned; raises ValueError if it does not fit."""


def checked(arrays: Mapping[str, np.ndarray], name: str, size: int) -> np.ndarray:
    """The array of that name, if it has `size` finite numbers."""
    array = arrays[name]
    if array.size != size or not np.isfinite(array).all():
        raise ValueError(f"map's {name} has {array.size} numbers; expected {size} finite")
    return array
