"""What runs on the study's surveys: parameters over config/default.yaml, by name.

The number of map nodes changes nothing in the results; one leaves the other core to another run.
"""

from __future__ import annotations

from typing import Any

import yaml

from bench.peers.peer_runs import PEERS
from rbpf_svgp_slam.nested import merged
from rbpf_svgp_slam.parameters.known import complaints, config_folder, default_parameters

ALONE = {"smoothing": {"period_s": 0.0}}
#: A study draws its own figures.
_ONE_NODE = {"nodes": 1, "output": {"figures": False}}


def _shipped(name: str) -> dict[str, Any]:
    return yaml.safe_load((config_folder() / f"{name}.yaml").read_text(encoding="utf-8"))


def _gmrf(particles: int, **over: Any) -> dict[str, Any]:
    return merged(merged(_shipped("gmrf"), {"particles": particles}), over)


#: default.yaml is the robust rule with SVGP maps, J = 40, and smoothing.
CONTESTANTS: dict[str, dict[str, Any]] = {
    "paper": _shipped("paper"),
    "svgp40-alone": ALONE,
    "svgp40": {},
    "gmrf40": _gmrf(40),
    "gmrf100-alone": _gmrf(100, **ALONE),
    "gmrf100": _gmrf(100),
    "gmrf1000-alone": _gmrf(1000, **ALONE),
    "gmrf1000": _gmrf(1000),
}


def overlay(name: str) -> dict[str, Any]:
    """The contestant's parameters, as in `gmrf100` or `gmrf100,lc/effective_beams=8`.

    Raises ValueError.
    """
    base, *changes = name.split(",")
    if base not in CONTESTANTS:
        known = ", ".join([*CONTESTANTS, *PEERS])
        raise ValueError(f"contestant is '{base}', expected one of {known}")
    result = merged(_ONE_NODE, CONTESTANTS[base])
    for change in changes:
        result = merged(result, _nested(change))
    for complaint in complaints(result, default_parameters()):
        raise ValueError(f"contestant is '{name}': {complaint}")
    return result


def _nested(change: str) -> dict[str, Any]:
    path, is_given, value = change.partition("=")
    if not is_given:
        raise ValueError(f"change of a contestant is '{change}', expected group/parameter=value")
    result: Any = yaml.safe_load(value)
    for key in reversed(path.split("/")):
        result = {key: result}
    return result
