"""The prior at the inducing points, factorised."""

from __future__ import annotations

import torch
from torch import Tensor

from rbpf_svgp_slam.svgp import linalg
from rbpf_svgp_slam.svgp.kernels import Correlation
from rbpf_svgp_slam.svgp.parameters import Model


class Prior:
    """ρ(Z, Z) + jitter·I = L Lᵀ of a model, and L⁻¹ in the model's precision.

    The factorisation is done in double precision: with a lengthscale of many inducing pitches the
    matrix's condition reaches S/jitter, 4·10⁶ at S = 400, and the posterior's small variances would
    be lost in single precision (docs/svgp.md). L's condition is only the root of that, and
    inverting it in single precision loses no more than ρ(Z, x) has lost already.
    """

    def __init__(
        self,
        inducing_points: int,
        kernel: str,
        jitter: float,
        dtype: torch.dtype,
        device: torch.device,
    ) -> None:
        shape = (inducing_points, inducing_points)
        self._jitter = jitter
        self.correlation = Correlation(kernel, shape, dtype, device)
        #: [S, S] lower triangular.
        self.L_inverse = torch.zeros(shape, dtype=dtype, device=device)
        #: How often the last factorisation had to raise the jitter.
        self.jitter_raises = 0
        self._stamp: object = None

    def factorise(self, model: Model, stamp: object = None) -> Tensor:
        """Return L⁻¹ [S, S] of the model; raises `NotPositiveDefinite`.

        If the last call had the same stamp, the model has to be the same, and nothing is done.
        """
        if stamp is not None and stamp is self._stamp:
            self.jitter_raises = 0
            return self.L_inverse
        self._stamp = None
        lengthscale, _, _ = model.hyperparameters()
        K = self.correlation.evaluate(model.Z, model.Z, lengthscale).double()
        L, self.jitter_raises = linalg.cholesky(K, self._jitter)
        self._stamp = stamp
        return linalg.inverse_of_lower(L.to(self.L_inverse.dtype), self.L_inverse)
