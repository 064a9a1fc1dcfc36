"""Where the map frame lies on the earth, and in the coordinates that a chart is drawn in.

The map frame is the plane that touches WGS 84's ellipsoid at the survey's origin, x to the east and
y to the north. As the filter does with fixes (fix_input.cpp), a place is taken at height 0 for its
x and y: at 100 m depth and 1 km from the origin that is 1.6 cm off.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pyproj
from pyproj.exceptions import CRSError

#: EPSG of heights above mean sea level.
MEAN_SEA_LEVEL = 5714
#: Where UTM has zones, degrees.
_UTM_SOUTH, _UTM_NORTH = -80.0, 84.0
# The plane's height below the ellipsoid is found anew with each; the third is below a micrometre
# 100 km from the origin.
_HEIGHT_ROUNDS = 3
# Long enough for 1e-10 rad with coordinates of 1e7 m in doubles, short against the earth.
_STEP_M = 10.0
_ROUND_TRIP_M = 1e-3


class Georeference:
    """The map frame's place on the earth. Positions [n, 2]: x, y of map; latitude, longitude in
    degrees; easting, northing in the projected CRS. Metres and radians elsewhere."""

    def __init__(
        self, origin_deg: tuple[float, float], epsg: int = 0, vertical_epsg: int = MEAN_SEA_LEVEL
    ) -> None:
        """origin_deg: latitude, longitude of map's origin, WGS 84; epsg: a projected CRS in metres,
        0: the UTM zone of the origin; vertical_epsg: heights in metres.

        Raises ValueError with the CRS's name and what was expected.
        """
        latitude, longitude = origin_deg
        if not -180.0 <= longitude < 180.0:
            longitude = (longitude + 180.0) % 360.0 - 180.0
        self.origin_deg = (float(latitude), float(longitude))
        self.epsg = epsg or utm_epsg(self.origin_deg)
        crs, vertical = projected_crs(self.epsg), _vertical_crs(vertical_epsg)
        self.name, self.vertical_name = crs.name, vertical.name
        self.vertical_epsg = vertical_epsg
        #: Both, as GDAL and PROJ take them.
        self.compound = f"EPSG:{self.epsg}+{vertical_epsg}"
        latitude, longitude = self.origin_deg
        self._plane = pyproj.Transformer.from_pipeline(
            "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad "
            "+step +proj=cart +ellps=WGS84 +step +proj=topocentric +ellps=WGS84 "
            f"+lat_0={latitude!r} +lon_0={longitude!r} +h_0=0"
        )
        self._projection = pyproj.Transformer.from_crs("EPSG:4326", crs, always_xy=True)
        self._expect_to_be_reached()

    def geographic(self, xy: np.ndarray) -> np.ndarray:
        """Latitude and longitude of positions in map."""
        x, y = np.asarray(xy, dtype=float).T
        z = np.zeros(len(x))
        for _ in range(_HEIGHT_ROUNDS):
            longitude, latitude, height = self._plane.transform(x, y, z, direction="INVERSE")
            z = z - height
        return np.column_stack([latitude, longitude])

    def from_geographic(self, places_deg: np.ndarray) -> np.ndarray:
        """Positions in map of latitudes and longitudes."""
        latitude, longitude = np.asarray(places_deg, dtype=float).T
        x, y, _ = self._plane.transform(longitude, latitude, np.zeros(len(latitude)))
        return np.column_stack([x, y])

    def projected(self, xy: np.ndarray) -> np.ndarray:
        """Easting and northing of positions in map."""
        latitude, longitude = self.geographic(xy).T
        return np.column_stack(self._projection.transform(longitude, latitude))

    def from_projected(self, en: np.ndarray) -> np.ndarray:
        """Positions in map of eastings and northings."""
        easting, northing = np.asarray(en, dtype=float).T
        longitude, latitude = self._projection.transform(easting, northing, direction="INVERSE")
        return self.from_geographic(np.column_stack([latitude, longitude]))

    def turn_to_grid_rad(self, xy: np.ndarray) -> np.ndarray:
        """Angle [n] by which a direction in map is turned, anticlockwise, to be one in the grid:
        at the origin the grid convergence."""
        d_easting, d_northing = (self.projected(_north_of(xy)) - self.projected(xy)).T
        return np.arctan2(d_northing, d_easting) - math.pi / 2

    def heading_rad(self, xy: np.ndarray, yaw_rad: np.ndarray) -> np.ndarray:
        """Headings [n] clockwise from true north, in [0, 2π), of yaw angles [n] in map."""
        here, there = self.geographic(xy), self.geographic(_north_of(xy))
        geod = pyproj.Geod(ellps="WGS84")
        north_deg, _, _ = geod.inv(here[:, 1], here[:, 0], there[:, 1], there[:, 0])
        return (np.deg2rad(north_deg) + math.pi / 2 - yaw_rad) % (2 * math.pi)

    def outside_of_use(self) -> str:
        """Where the CRS is meant for, if the origin is not there; else empty."""
        latitude, longitude = self.origin_deg
        area = pyproj.CRS.from_epsg(self.epsg).area_of_use
        if area is None:
            return ""
        east_of_west = (longitude - area.west) % 360.0 <= (area.east - area.west) % 360.0 or (
            area.east - area.west >= 360.0
        )
        return "" if east_of_west and area.south <= latitude <= area.north else area.name

    def _expect_to_be_reached(self) -> None:
        origin = np.zeros((1, 2))
        en = self.projected(origin)
        if np.isfinite(en).all() and np.abs(self.from_projected(en)).max() < _ROUND_TRIP_M:
            return
        latitude, longitude = self.origin_deg
        raise ValueError(
            f"EPSG:{self.epsg} ({self.name}) does not reach latitude {latitude:g}, longitude "
            f"{longitude:g}; expected a projected CRS for the survey's origin"
        )


class LocalFrame:
    """A map frame of which nobody has said where on the earth it lies: a chart of it has its x and
    y for coordinates, and no north."""

    def projected(self, xy: np.ndarray) -> np.ndarray:
        """Positions [n, 2] as they are, m."""
        return np.asarray(xy, dtype=float)

    from_projected = projected


def georeference_of(config: dict[str, Any]) -> Georeference | None:
    """The place that a run's parameters tell; None where they tell none.

    Raises ValueError with what is wrong with them.
    """
    if not config.get("survey_origin"):
        return None
    return Georeference(tuple(config["survey_origin"]), config.get("survey_epsg") or 0)


def utm_epsg(origin_deg: tuple[float, float]) -> int:
    """The UTM zone of a place on WGS 84, six degrees of longitude each: the wider zones of Norway
    and Svalbard are for survey_epsg to name."""
    latitude, longitude = origin_deg
    if not _UTM_SOUTH <= latitude <= _UTM_NORTH:
        raise ValueError(
            f"latitude {latitude:g} has no UTM zone; expected a projected CRS by --epsg, or the "
            "parameter survey_epsg"
        )
    zone = int((longitude + 180.0) % 360.0 // 6.0) + 1
    return (32600 if latitude >= 0 else 32700) + zone


def projected_crs(epsg: int) -> pyproj.CRS:
    """The CRS of an EPSG code; raises ValueError if it is not projected and in metres."""
    crs = _crs(epsg, "a projected CRS in metres")
    if not crs.is_projected or crs.is_compound:
        raise ValueError(f"EPSG:{epsg} is {crs.name}; expected a projected CRS in metres")
    units = {axis.unit_name for axis in crs.axis_info}
    if units != {"metre"}:
        raise ValueError(
            f"EPSG:{epsg} is {crs.name}, in {', '.join(sorted(units))}; expected a projected CRS "
            "in metres"
        )
    return crs


def _north_of(xy: np.ndarray) -> np.ndarray:
    return np.asarray(xy, dtype=float) + [0.0, _STEP_M]


def _vertical_crs(epsg: int) -> pyproj.CRS:
    expected = "a vertical CRS of heights in metres, as 5714"
    crs = _crs(epsg, expected)
    axes = [(axis.direction, axis.unit_name) for axis in crs.axis_info]
    if not crs.is_vertical or crs.is_compound or axes != [("up", "metre")]:
        raise ValueError(f"EPSG:{epsg} is {crs.name}; expected {expected}")
    return crs


def _crs(epsg: int, expected: str) -> pyproj.CRS:
    try:
        return pyproj.CRS.from_epsg(epsg)
    except CRSError as error:
        raise ValueError(f"EPSG:{epsg} is unknown to PROJ; expected {expected}") from error
