"""The loop closures of a run: windows of pings registered against maps of older windows' beams."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rbpf_svgp_slam.run.columns import Columns

ACCEPTED = "accepted"


@dataclass
class Closures(Columns):
    """C closures, accepted or not, in columns named as the fields of Closure.msg.

    Poses are x, y, yaw in m and rad.
    """

    KINDS = {
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

    stamp: np.ndarray  # [C] s, middle of the younger window of pings
    stamp_older: np.ndarray  # [C] s, of the older one
    relative: np.ndarray  # [C, 3] the younger pose in the older one's frame, as registered
    covariance: np.ndarray  # [C, 6] of it: xx, xy, x yaw, yy, y yaw, yaw yaw
    shift: np.ndarray  # [C, 3] what registration moved the younger window by, in map
    rms_m: np.ndarray  # [C] of the beams about the map
    beams: np.ndarray  # [C] that lay on the map
    weight: np.ndarray  # [C] in the graph, 0 to 1; NaN if refused
    verdict: np.ndarray  # [C] "accepted", or why not

    @property
    def accepted(self) -> np.ndarray:
        """[C] bool."""
        return self.verdict == ACCEPTED
