"""The map frame on the earth: a plane that touches it at the survey's origin, x east, y north.

As rbpf_core places absolute fixes (src/rbpf_node/inputs/fix_input.cpp): heights are left out.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from rbpf_svgp_slam.importers.sonar_file import ImportProblem

#: Geographic latitude, longitude of WGS84, and its height above the ellipsoid; geocentric X, Y, Z.
GEOGRAPHIC_3D, GEOCENTRIC = "EPSG:4979", "EPSG:4978"


class LocalFrame:
    """East and north of an origin, WGS84."""

    def __init__(self, latitude_deg: float, longitude_deg: float) -> None:
        if not (abs(latitude_deg) <= 90 and abs(longitude_deg) <= 360):
            raise ImportProblem(
                f"origin is {latitude_deg}, {longitude_deg}, expected a latitude within ±90° and a "
                "longitude within ±360°"
            )
        self.origin_deg = (latitude_deg, longitude_deg)
        self._to_geocentric = _pyproj().Transformer.from_crs(GEOGRAPHIC_3D, GEOCENTRIC)
        self._origin_m = self._geocentric(latitude_deg, longitude_deg)
        latitude, longitude = np.radians(self.origin_deg)
        sin_lat, cos_lat = np.sin(latitude), np.cos(latitude)
        sin_lon, cos_lon = np.sin(longitude), np.cos(longitude)
        self._east = np.array([-sin_lon, cos_lon, 0.0])
        self._north = np.array([-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat])

    def east_north(self, latitude_deg: np.ndarray, longitude_deg: np.ndarray) -> np.ndarray:
        """x, y [N, 2] of places [N], m."""
        from_origin_m = self._geocentric(latitude_deg, longitude_deg) - self._origin_m
        return np.stack([from_origin_m @ self._east, from_origin_m @ self._north], axis=-1)

    def distance_m(self, latitude_deg: float, longitude_deg: float) -> float:
        """From the origin to a place, straight through the earth."""
        return float(np.linalg.norm(self._geocentric(latitude_deg, longitude_deg) - self._origin_m))

    def _geocentric(self, latitude_deg: Any, longitude_deg: Any) -> np.ndarray:
        height_m = np.zeros_like(np.asarray(latitude_deg, float))
        return np.stack(
            self._to_geocentric.transform(latitude_deg, longitude_deg, height_m), axis=-1
        )


def _pyproj() -> Any:
    try:
        import pyproj  # needed for imports alone
    except ImportError as error:
        raise ImportProblem(
            f"positions are read with pyproj, which is not there ({error}); apt-get install "
            "python3-pyproj"
        ) from error
    return pyproj
