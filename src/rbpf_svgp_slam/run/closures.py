"""The loop closures of a run: windows of pings registered against maps of older windows' beams."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

ACCEPTED = "accepted"

# Of each column: what its elements are, and the shape of one closure's.
_COLUMNS: dict[str, tuple[type, tuple[int, ...]]] = {
    "stamp": (float, ()),
    "stamp_older": (float, ()),
    "relative": (float, (3,)),
    "covariance": (float, (6,)),
    "shift": (float, (3,)),
    "rms_m": (float, ()),
    "beams": (int, ()),
    "weight": (float, ()),
    "verdict": (str, ()),
}


@dataclass
class Closures:
    """C closures, accepted or not, in columns named as the fields of Closure.msg.

    Poses are x, y, yaw in m and rad.
    """

    stamp: np.ndarray  # [C] s, middle of the younger window of pings
    stamp_older: np.ndarray  # [C] s, of the older one
    relative: np.ndarray  # [C, 3] the younger pose in the older one's frame, as registered
    covariance: np.ndarray  # [C, 6] of it: xx, xy, x yaw, yy, y yaw, yaw yaw
    shift: np.ndarray  # [C, 3] what registration moved the younger window by, in map
    rms_m: np.ndarray  # [C] of the beams about the map
    beams: np.ndarray  # [C] that lay on the map
    weight: np.ndarray  # [C] in the graph, 0 to 1; NaN if refused
    verdict: np.ndarray  # [C] "accepted", or why not

    def __post_init__(self) -> None:
        for name, (_, shape) in _COLUMNS.items():
            expected, got = (len(self.stamp), *shape), np.shape(getattr(self, name))
            if got != expected:
                raise ValueError(f"closures' {name}: expected shape {expected}, got {got}")

    @classmethod
    def of(cls, rows: Iterable[Any]) -> Closures:
        """From objects with these attributes, as messages are."""
        rows = list(rows)
        return cls(
            **{
                name: np.array([getattr(row, name) for row in rows], dtype).reshape(-1, *shape)
                for name, (dtype, shape) in _COLUMNS.items()
            }
        )

    @property
    def accepted(self) -> np.ndarray:
        """[C] bool."""
        return self.verdict == ACCEPTED

    def rows(self) -> list[dict[str, Any]]:
        """A dictionary for each closure."""
        names = [field.name for field in fields(self)]
        return [dict(zip(names, row)) for row in zip(*(getattr(self, name) for name in names))]
