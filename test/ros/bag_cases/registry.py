"""All cases, by name."""

from __future__ import annotations

from bag_cases import (
    clocks,
    combined,
    formats,
    geometry,
    mounts,
    names,
    recordings,
    truths,
    twists,
)
from bag_cases.expected import Case

_ROOMS = twists, clocks, geometry, mounts, names, formats, truths, recordings, combined

CASES: dict[str, Case] = {case.name: case for room in _ROOMS for case in room.CASES}
