"""The absolute positions of a run: GPS at a surfacing, USBL from a ship, an operator's pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rbpf_svgp_slam.run.columns import Columns


@dataclass
class Fixes(Columns):
    """F fixes that the filter has taken, in columns named as the fields of Fix.msg; frame map.

    Another program's fixes.npz may lack the columns that have a default: they are not known then.
    """

    KINDS = {
        "stamp": (float, ()),
        "position": (float, (2,)),
        "covariance": (float, (3,)),
        "yaw": (float, ()),
        "yaw_variance": (float, ()),
        "dead_reckoning": (float, (3,)),
    }

    stamp: np.ndarray  # [F] s
    position: np.ndarray  # [F, 2] of base_link, m
    covariance: np.ndarray  # [F, 3] of it: xx, xy, yy, m²
    yaw: np.ndarray | None = None  # [F] rad, where a pose was given; else NaN
    yaw_variance: np.ndarray | None = None  # [F] of it, rad²; else NaN
    dead_reckoning: np.ndarray | None = None  # [F, 3] x, y, yaw then, m and rad; NaN: not known

    def __post_init__(self) -> None:
        for name, (_, shape) in self.KINDS.items():
            if getattr(self, name) is None:
                setattr(self, name, np.full((len(self), *shape), np.nan))
        super().__post_init__()
