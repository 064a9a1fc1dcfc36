"""What the smoother is told, from the parameters of a run: motion, start and smoothing."""

from __future__ import annotations

import math
from typing import Any

from rbpf_svgp_slam import _smoothing

#: Names of each group, as in config/default.yaml, and the least value of each; the smoother's own
#: defaults are those of that file.
MOTION = {"surge_std_m": 0.0, "sway_std_m": 0.0, "yaw_std_rad": 0.0}
START = {"position_std_m": 0.0, "yaw_std_rad": 0.0}
BIASES = {
    "velocity_bias_std_mps": 0.0,
    "yaw_bias_std_radps": 0.0,
    "current_std_mps": 0.0,
    "bias_time_s": 1.0,
}
REGISTRATION = {
    "window_s": 1.0,
    "map_window_s": 1.0,
    "min_apart_s": 2.0,
    "passes": 1,
    "effective_beams": 1.0,
    "max_search_m": 1.0,
}


def smoothing_params(config: dict[str, Any]) -> _smoothing.SmoothingParams:
    """Take what the parameters of a run say, and the defaults for what they do not.

    Raises ValueError, which names the parameter, its value and what was expected.
    """
    params = _smoothing.SmoothingParams()
    # A copy is what the binding hands out: it has to be put back.
    motion, registration = params.motion, params.registration
    for name, value in _values(config, "motion", MOTION):
        setattr(motion, name, value)
    for name, value in _values(config, "start", START):
        setattr(params, f"start_{name}", value)
    for name, value in _values(config, "smoothing", BIASES):
        setattr(params, name, value)
    for name, value in _values(config, "smoothing", REGISTRATION):
        setattr(registration, name, value)
    params.motion, params.registration = motion, registration
    return params


def _values(config: dict[str, Any], group: str, least: dict[str, float]):
    """Yield names and values of the group that are given."""
    given = config.get(group) or {}
    if not isinstance(given, dict):
        raise ValueError(f"{group} is {given!r}; expected parameters by name")
    for name, bound in least.items():
        if name not in given:
            continue
        value, whole = given[name], isinstance(bound, int)
        kind = "an integer" if whole else "a finite number"
        number = isinstance(value, int if whole else (int, float)) and not isinstance(value, bool)
        if not number or not math.isfinite(value) or value < bound:
            raise ValueError(f"{group}/{name} is {value!r}; expected {kind} from {bound:g}")
        yield name, value
