"""Settings of the engine gmrf. The defaults are those of config/default.yaml, which explains them;
a test holds the two together."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Mapping

from rbpf_svgp_slam.parameters.rules import ParameterError, between, checked


@dataclass(frozen=True)
class GmrfConfig:
    """Each is 0 where the beams are to tell."""

    #: h, distance between the nodes of the grid, m
    spacing_m: float = 0.0
    #: l, distance over which the seabed's depths are alike, m
    lengthscale_m: float = 0.0
    #: o, variance of the seabed about its mean, m²
    outputscale_m2: float = 0.0
    #: sigma, standard deviation of a beam about the seabed, m
    noise_std_m: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = checked(f"gmrf/{field.name}", getattr(self, field.name), between(0.0, 1e7))
            object.__setattr__(self, field.name, value)

    @classmethod
    def from_parameters(cls, tree: Mapping[str, Any]) -> GmrfConfig:
        """From the parameter group `gmrf`."""
        known = [field.name for field in fields(cls)]
        for name in tree:
            if name not in known:
                raise ParameterError(f"gmrf/{name} is unknown; expected one of {', '.join(known)}")
        return cls(**tree)
