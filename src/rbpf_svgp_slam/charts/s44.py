"""Orders of IHO S-44, edition 6.1.0, that depths meet by their vertical uncertainty alone.

The largest total vertical uncertainty at depth d, with 95 % confidence, is sqrt(a² + (b d)²). An
order also asks for the horizontal uncertainty, for features detected and for coverage, which are
not looked at here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: Standard deviations of a Gaussian within which 95 % lie.
SIGMAS_95 = 1.959964
#: For every reader of them.
BY_TVU_ALONE = (
    "IHO S-44 edition 6.1.0, by total vertical uncertainty (95 %) alone: horizontal uncertainty, "
    "feature detection and coverage are other criteria."
)
NO_ORDER = 0
UNKNOWN = 255


@dataclass(frozen=True)
class Order:
    """One or several orders of the same vertical uncertainty."""

    code: int  # of a cell that meets it, and no stricter one
    name: str
    a_m: float
    b: float

    def largest_m(self, depth_m: np.ndarray) -> np.ndarray:
        """Total vertical uncertainty allowed, 95 %."""
        return np.hypot(self.a_m, self.b * depth_m)


#: From the least to the most strict: S-44's table 1.
ORDERS = (
    Order(1, "2", 1.0, 0.023),
    Order(2, "1a, 1b", 0.5, 0.013),
    Order(3, "Special", 0.25, 0.0075),
    Order(4, "Exclusive", 0.15, 0.0075),
)
NAMES = {NO_ORDER: "none", **{order.code: order.name for order in ORDERS}}


def orders_met(elevation_m: np.ndarray, std_m: np.ndarray) -> np.ndarray:
    """Code of the strictest order that each cell meets, uint8; UNKNOWN where a value is NaN."""
    depth_m = np.maximum(-elevation_m, 0.0)
    codes = np.full(elevation_m.shape, NO_ORDER, np.uint8)
    for order in ORDERS:
        codes[SIGMAS_95 * std_m <= order.largest_m(depth_m)] = order.code
    codes[np.isnan(elevation_m) | np.isnan(std_m)] = UNKNOWN
    return codes


def shares(codes: np.ndarray) -> dict[str, float]:
    """Share of the known cells whose strictest order is each, by name, the strictest first."""
    known = codes[codes != UNKNOWN]
    return {
        NAMES[code]: float(np.mean(known == code)) if known.size else 0.0
        for code in sorted(NAMES, reverse=True)
    }


def shares_within(shares_of: dict[str, float]) -> dict[str, float]:
    """Share of the cells within each order's vertical uncertainty, by name, the strictest first:
    a cell is within all orders that are less strict than the strictest that it meets.

    shares_of: as shares() has them.
    """
    within, total = {}, 0.0
    for order in reversed(ORDERS):
        total += shares_of[order.name]
        within[order.name] = total
    return within
