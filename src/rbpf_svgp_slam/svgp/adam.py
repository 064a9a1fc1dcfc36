"""Adam (Kingma and Ba 2015, Algorithm 1) on one flat vector, without allocations."""

from __future__ import annotations

import math
from typing import Iterable

import torch
from torch import Tensor

EPSILON = 1e-8


class Adam:
    """Ascends an objective; constants are the paper's, which are also the defaults of torch."""

    def __init__(
        self,
        size: int,
        dtype: torch.dtype,
        device: torch.device,
        beta_1: float = 0.9,
        beta_2: float = 0.999,
    ) -> None:
        self._beta_1, self._beta_2 = beta_1, beta_2
        self.steps = 0
        self.first, self.second, self._scratch = (
            torch.zeros(size, dtype=dtype, device=device) for _ in range(3)
        )

    def step(
        self, parameters: Tensor, gradient: Tensor, rates: Iterable[tuple[int, float]]
    ) -> None:
        """Move parameters [P] up the gradient [P].

        rates: pairs (n, learning rate); the first holds for the first n parameters, and so on.
        """
        self.steps += 1
        # first = β₁·first + (1 − β₁)·g        second = β₂·second + (1 − β₂)·g²
        self.first.mul_(self._beta_1).add_(gradient, alpha=1.0 - self._beta_1)
        self.second.mul_(self._beta_2).addcmul_(gradient, gradient, value=1.0 - self._beta_2)
        # θ += rate·(first/(1 − β₁ᵗ)) / (√(second/(1 − β₂ᵗ)) + ε)
        correction_1 = 1.0 - self._beta_1**self.steps
        correction_2 = math.sqrt(1.0 - self._beta_2**self.steps)
        torch.sqrt(self.second, out=self._scratch).div_(correction_2).add_(EPSILON)
        start = 0
        for n, rate in rates:
            part = slice(start, start + n)
            parameters[part].addcdiv_(
                self.first[part], self._scratch[part], value=rate / correction_1
            )
            start += n
