"""Settings of an SVGP map: units, where they come from, and their validation.

The defaults are those of config/default.yaml, which explains them; a test holds the two together.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, fields
from typing import Any, Mapping

from rbpf_svgp_slam.parameters.rules import (
    ParameterError,
    Rule,
    checked,
    choice,
    finite,
    of_type,
)
from rbpf_svgp_slam.svgp.kernels import KERNELS
from rbpf_svgp_slam.svgp.parameters import FLOORS

#: The σ, m, whose square is the floor of σ².
SMALLEST_NOISE_STD_M = math.sqrt(FLOORS[2])
#: Beyond it a number is a slip.
_MOST = 1e9


def _above(low: float, or_zero: bool = False) -> Rule:
    expected = f"{'0 or ' if or_zero else ''}a number above {low:g}, up to {_MOST:g}"
    return Rule(
        expected,
        lambda value: low < value <= _MOST or (or_zero and value == 0.0),
        float,
        first=finite(),
    )


def _count(most: int) -> Rule:
    expected = f"a whole number from 1 to {most}"
    return Rule(expected, lambda value: 1 <= value <= most, first=of_type(int))


_COUNT = _count(10**9)
_SHARE = Rule("a number between 0 and 1", lambda value: 0.0 < value < 1.0, float, first=finite())
_RATE = Rule("a number above 0, up to 1", lambda value: 0.0 < value <= 1.0, float, first=finite())

#: The rule of each setting that has one beside its type.
RULES: dict[str, Rule] = {
    # a map holds S x S numbers, a prediction n x S
    "inducing_points": _count(5000),
    # what the core hands out at once
    "minibatch_size": _count(1_000_000),
    "kernel": choice(*KERNELS),
    "optimizer": choice("adam", "natgrad", "streaming"),
    "learning_rate": _above(0.0),
    "natgrad_rate": _RATE,
    "natgrad_model_period": _COUNT,
    "natgrad_inducing_rate": _above(0.0),
    "natgrad_hyperparameter_rate": _above(0.0),
    "natgrad_cooling_steps": _COUNT,
    "shared_hyperparameters": of_type(bool),
    "streaming_tolerance": _above(0.0),
    "streaming_rebuild_beams": _COUNT,
    "lengthscale_m": _above(FLOORS[0], or_zero=True),
    "outputscale_m2": _above(FLOORS[1]),
    "noise_std_m": _above(SMALLEST_NOISE_STD_M),
    "jitter": _SHARE,
    "learn_inducing_points": of_type(bool),
    "learn_hyperparameters": of_type(bool),
    "convergence_decay": _SHARE,
    "convergence_window": _COUNT,
    "convergence_tolerance": _above(0.0),
    "device": choice("cpu", "cuda"),
    "dtype": choice("float32", "float64"),
}


@dataclass(frozen=True)
class SvgpConfig:
    """The defaults are Torroba et al.'s (2023, Table 1) where they are marked with (paper)."""

    #: S (paper)
    inducing_points: int = 400
    #: M, beams per step (paper)
    minibatch_size: int = 1000
    #: matern12: k(r) = o·exp(−r/ℓ) (paper); matern32, matern52
    kernel: str = "matern12"
    #: adam (paper), natgrad, streaming
    optimizer: str = "streaming"
    #: of the optimizer adam, for all parameters (paper)
    learning_rate: float = 0.1
    #: of natural-gradient steps: the newest minibatch's share of q(v)
    natgrad_rate: float = 0.1
    #: steps from one update of Z, ℓ, o, σ² and c to the next
    natgrad_model_period: int = 1
    #: first rate of Adam for Z, inducing pitches
    natgrad_inducing_rate: float = 0.1
    #: first rate of Adam for log ℓ and log o
    natgrad_hyperparameter_rate: float = 0.3
    #: updates after which these two rates are halved; they fall as 1/t, to a tenth
    natgrad_cooling_steps: int = 50
    #: one model for all maps of a node: natgrad only
    shared_hyperparameters: bool = False
    #: a streaming map takes its teacher's model over once that has moved by this much: Z in
    #: inducing pitches (RMS), ℓ, o and σ² as logarithms, c in √o
    streaming_tolerance: float = 0.1
    #: beams drawn from the log for that, if it has more
    streaming_rebuild_beams: int = 40000
    #: initial ℓ, m; 0: half of the inducing grid's pitch. One of a whole pitch or two correlates
    #: the inducing points, and Adam then takes about twice as many steps to a given map error
    lengthscale_m: float = 0.0
    #: initial o, prior variance of the seabed about its mean, m². natgrad, if it learns o and σ,
    #: takes both from the first minibatch
    outputscale_m2: float = 1.0
    #: initial σ, standard deviation of a beam about the map, m
    noise_std_m: float = 0.3
    #: added to the diagonal of Kzz, as a share of o; GPyTorch's default for variational models
    jitter: float = 1e-4
    #: (paper)
    learn_inducing_points: bool = True
    #: ℓ, o, σ² and c (paper)
    learn_hyperparameters: bool = True
    #: of the moving average of the ELBO, per step
    convergence_decay: float = 0.97
    #: steps between the two averages that are compared
    convergence_window: int = 50
    #: largest relative change over the window (convergence.py)
    convergence_tolerance: float = 0.1
    #: cpu, cuda
    device: str = "cpu"
    #: float32; float64 for matern32 and matern52 if their ℓ grows to many inducing pitches
    dtype: str = "float32"

    def __post_init__(self) -> None:
        for field in fields(self):
            value = checked(f"svgp/{field.name}", getattr(self, field.name), RULES[field.name])
            object.__setattr__(self, field.name, value)
        can_share = Rule(
            f"false with optimizer {self.optimizer}: natgrad can share, streaming always does",
            lambda shares: not shares or self.optimizer == "natgrad",
        )
        checked("svgp/shared_hyperparameters", self.shared_hyperparameters, can_share)

    @classmethod
    def from_parameters(cls, tree: Mapping[str, Any]) -> "SvgpConfig":
        """From the parameter group `svgp`; natgrad/rate, say, is natgrad_rate here."""
        flat = {}
        for name, value in tree.items():
            if isinstance(value, Mapping):
                flat.update({f"{name}_{key}": below for key, below in value.items()})
            else:
                flat[name] = value
        known = [field.name for field in fields(cls)]
        for name in flat:
            if name not in known:
                raise ParameterError(f"svgp/{name} is unknown; expected one of {', '.join(known)}")
        return cls(**flat)

    def as_dict(self) -> dict[str, Any]:
        """Name and value of each setting."""
        return asdict(self)
