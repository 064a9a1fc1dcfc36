"""q(v) in closed form from running sums over all of a particle's beams."""

from __future__ import annotations

import math
import threading
from typing import Callable, Mapping

import numpy as np
import torch
from torch import Tensor

from rbpf_svgp_slam.svgp import linalg
from rbpf_svgp_slam.svgp.config import SvgpConfig
from rbpf_svgp_slam.svgp.kernels import Correlation
from rbpf_svgp_slam.svgp.natural import Moments, moments
from rbpf_svgp_slam.svgp.optimizers.optimizer import (
    Optimizer,
    checked,
    expect_squares,
    fill,
    packed,
    unpack,
)
from rbpf_svgp_slam.svgp.parameters import Model
from rbpf_svgp_slam.svgp.posterior import Gaussian
from rbpf_svgp_slam.svgp.prior import Prior

_thread = threading.local()
#: So many beams are added at once, which bounds the memory taken.
BLOCK = 1024


class FixedModel:
    """A model that does not change any more, and its L⁻¹, which all maps under it share."""

    def __init__(self, config: SvgpConfig, flat: Tensor) -> None:
        self.model = Model(flat.clone())
        self._config = config
        self._L_inverse: Tensor | None = None

    @property
    def L_inverse(self) -> Tensor:
        """[S, S], factorised at the first use."""
        if self._L_inverse is None:
            config, flat = self._config, self.model.flat
            args = (config.inducing_points, config.kernel, config.jitter, flat.dtype, flat.device)
            self._L_inverse = Prior(*args).factorise(self.model)
        return self._L_inverse


class Sums:
    """Over beams, of a aᵀ [S, S], a·y [S] and a [S], all in double precision."""

    def __init__(self, inducing_points: int, device: torch.device) -> None:
        S, double = inducing_points, torch.float64
        self.gram = torch.zeros((S, S), dtype=double, device=device)
        self.depth, self.one = torch.zeros((2, S), dtype=double, device=device)

    def scale(self, factor: float) -> None:
        """Let the beams count so many times."""
        for total in (self.gram, self.depth, self.one):
            total.mul_(factor)


class Streaming(Optimizer):
    """Takes in every beam once; for a fixed model q(v) is then exactly the best there is.

    The model comes from another map, which learns it from minibatches. When that has moved on, the
    sums are to be rebuilt under its new model. They are sums over the beams of a aᵀ, a·y and a,
    where a = L⁻¹ρ(Z, x). Beams are whitened before they are summed, because L⁻¹(Σρρᵀ)L⁻ᵀ would
    subtract large numbers, and is not always positive, not even in double precision.

    State: `model` [2S + 4] Z [S, 2], raw ℓ, o, σ² and c; `gram` [S(S + 1)/2], the sum of a aᵀ by
    rows up to the diagonal, `sum_depth` [S] of a·y and `sum_one` [S] of a, all in double
    precision; `next_beam`, how many of the log's beams these are.
    """

    ENTRIES = {
        "model": ("f", 1),
        "gram": ("f", 1),
        "sum_depth": ("f", 1),
        "sum_one": ("f", 1),
        "next_beam": ("i", 0),
    }

    def __init__(self, config: SvgpConfig) -> None:
        super().__init__(config)
        S = config.inducing_points
        #: The model and what depends on it alone.
        self.fixed = FixedModel(config, Model.zeros(S, self.dtype, self.device).flat)
        self._sums = Sums(S, self.device)
        #: Index in the log of the first beam that has not been taken in.
        self.next_beam = 0

    @property
    def model(self) -> Model:
        return self.fixed.model

    def start(self, Z: np.ndarray, lengthscale_m: float, pitch_m: float) -> None:
        model = Model.zeros(len(Z), self.dtype, self.device)
        self._start(model, Z, lengthscale_m)
        self.fixed = FixedModel(self.config, model.flat)

    def fold(self, X: Tensor, y: Tensor) -> None:
        """Take in the log's next beams X [n, 2], m, y [n], m; raises `NotFinite`."""
        expect_squares(y)
        self._add(X, y, self.fixed, self._sums)
        self.next_beam += len(y)

    def rebuild(
        self,
        fixed: FixedModel,
        X: Tensor,
        y: Tensor,
        N: int,
        pause: Callable[[], None] = lambda: None,
    ) -> None:
        """The sums under another model, for the log's first N beams, of which X, y are a sample.

        pause: called after each block, while everything is as it was.
        """
        expect_squares(y)
        sums = Sums(self.config.inducing_points, self.device)
        self._add(X, y, fixed, sums, pause)
        self.fixed, self._sums, self.next_beam = fixed, sums, len(y)
        self.stand_for(N)

    def stand_for(self, N: int) -> None:
        """What has been taken in was a sample of the log's first N beams."""
        self._sums.scale(N / self.next_beam)
        self.next_beam = N

    def share_if_equal(self, fixed: FixedModel) -> None:
        """Use that object for the model, if it is the same model: L⁻¹ is then computed once."""
        if torch.equal(self.fixed.model.flat, fixed.model.flat):
            self.fixed = fixed

    def gaussian(self) -> Gaussian:
        q = self.moments()
        return Gaussian.from_inverse_root(q.m.to(self.dtype), q.F)

    def moments(self) -> Moments:
        """q(v) under the fixed model: Λ = I + o/σ²·Σa aᵀ, Λm = √o/σ²·Σa(y − c)."""
        (_, o, noise), sums = self.model.hyperparameters(), self._sums
        shift = (sums.depth - self.model.c.item() * sums.one) / math.sqrt(o)
        return moments(sums.gram, shift, o / noise, self.dtype)

    def _shared(self) -> list[object]:
        return [self.config, self.fixed]

    def prior_inverse(self) -> Tensor:
        return self.fixed.L_inverse

    def arrays(self) -> dict[str, np.ndarray]:
        return {
            "model": self.model.flat.cpu().numpy(),
            "gram": packed(self._sums.gram),
            "sum_depth": self._sums.depth.cpu().numpy(),
            "sum_one": self._sums.one.cpu().numpy(),
            "next_beam": np.array(self.next_beam),
        }

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        S, sums = self.config.inducing_points, self._sums
        model = Model.zeros(S, self.dtype, self.device)
        fill(arrays, model=model.flat, sum_depth=sums.depth, sum_one=sums.one)
        unpack(checked(arrays, "gram", S * (S + 1) // 2), sums.gram)
        self.fixed = FixedModel(self.config, model.flat)
        self.next_beam = arrays["next_beam"].item()

    def _add(
        self,
        X: Tensor,
        y: Tensor,
        fixed: FixedModel,
        sums: Sums,
        pause: Callable[[], None] = lambda: None,
    ) -> None:
        """Add beams X [n, 2], y [n] to sums under a model; pause: called after each block."""
        lengthscale = fixed.model.hyperparameters()[0]
        for X_part, y_part in zip(X.split(BLOCK), y.split(BLOCK)):
            correlation, white, product = self._buffers(len(y_part))
            rho = correlation.evaluate(fixed.model.Z, X_part, lengthscale)
            # The projections may be rounded to single precision: a sum of a aᵀ stays positive.
            A = linalg.product_with_lower(fixed.L_inverse, rho, white).double()
            sums.gram.add_(linalg.gram(A, product))
            sums.depth.add_(torch.mv(A, y_part.double()))
            sums.one.add_(A.sum(1))
            pause()

    def _buffers(self, n: int) -> tuple[Correlation, Tensor, Tensor]:
        """This thread's work space for n beams; maps share it."""
        S, key = self.config.inducing_points, (self.config, n, self.dtype, self.device)
        if getattr(_thread, "key", None) != key:
            _thread.correlation = Correlation(self.config.kernel, (S, n), self.dtype, self.device)
            _thread.white = torch.empty((S, n), dtype=self.dtype, device=self.device)
            _thread.product = torch.empty((S, S), dtype=torch.float64, device=self.device)
            _thread.key = key
        return _thread.correlation, _thread.white, _thread.product
