"""Map's place on the earth: against GeographicLib, closed forms, and CRSs that are none."""

import math

import numpy as np
import pyproj
import pytest

from rbpf_svgp_slam.charts.georeference import Georeference, utm_epsg

ORIGIN = (57.5, 11.2)


@pytest.fixture(scope="module")
def georeference():
    return Georeference(ORIGIN)


def test_map_is_the_plane_that_fixes_are_placed_in(georeference):
    """Values of GeographicLib::LocalCartesian, as fix_input.cpp calls it, to the micrometre."""
    places = [[57.6, 11.5], [57.45, 11.1], [58.2, 9.9]]
    xy = [[17937.160456, 11176.568157], [-6003.674841, -5563.998257], [-76437.07168, 78691.936183]]
    np.testing.assert_allclose(georeference.from_geographic(places), xy, atol=1e-6)
    # 1e-6 m are 1e-11 degrees.
    np.testing.assert_allclose(georeference.geographic(xy), places, atol=3e-11)


def test_there_and_back(georeference):
    xy = np.random.default_rng(0).uniform(-20e3, 20e3, (50, 2))
    back = georeference.from_projected(georeference.projected(xy))
    # What three rounds for the height leave, and PROJ's own rounding.
    np.testing.assert_allclose(back, xy, atol=1e-6)


def test_the_origin_lies_in_its_utm_zone_turned_by_the_convergence(georeference):
    assert (georeference.epsg, georeference.name) == (32632, "WGS 84 / UTM zone 32N")
    easting, northing = pyproj.Proj("+proj=utm +zone=32 +ellps=WGS84")(11.2, 57.5)
    np.testing.assert_allclose(georeference.projected([[0, 0]]), [[easting, northing]], atol=1e-6)
    # Of the sphere, with which the ellipsoid's agrees to (Δλ)² e²: a ten thousandth of it here.
    convergence = math.atan(math.tan(math.radians(11.2 - 9)) * math.sin(math.radians(57.5)))
    assert georeference.turn_to_grid_rad(np.zeros((1, 2))) == pytest.approx(convergence, rel=1e-4)


def test_headings_are_from_true_north_where_the_vehicle_is(georeference):
    xy = np.array([[0.0, 0.0], [0.0, 0.0], [5000.0, 0.0]])
    yaw = np.array([0.0, math.radians(100), math.pi / 2])
    heading = np.rad2deg(georeference.heading_rad(xy, yaw))
    np.testing.assert_allclose(heading[:2], [90, 350], atol=1e-6)
    # 5 km to the east true north has turned to the left of map's y by Δλ sin φ.
    longitude = georeference.geographic(xy[2:])[0, 1]
    assert heading[2] == pytest.approx((longitude - 11.2) * math.sin(math.radians(57.5)), rel=1e-3)


@pytest.mark.parametrize(
    "place, epsg",
    [
        ((57.5, 11.2), 32632),
        ((-33.9, 18.4), 32734),
        ((10, -180), 32601),
        ((10, 179.9), 32660),
        ((0, 539.9), 32660),
    ],
)
def test_utm_zones(place, epsg):
    assert utm_epsg(place) == epsg
    assert Georeference(place).epsg == epsg


def test_southern_and_western_surveys_are_north_up():
    georeference = Georeference((-33.9, -71.7))
    origin, north, east = georeference.projected([[0, 0], [0, 100], [100, 0]])
    assert north[1] - origin[1] > 99 and east[0] - origin[0] > 99


@pytest.mark.parametrize(
    "settings, message",
    [
        ({"epsg": 4326}, "EPSG:4326 is WGS 84; expected a projected CRS in metres"),
        ({"epsg": 2263}, r"NAD83 / New York Long Island \(ftUS\), in US survey foot; expected a"),
        ({"epsg": 5714}, "EPSG:5714 is MSL height; expected a projected CRS"),
        ({"epsg": 999999}, "EPSG:999999 is unknown to PROJ; expected a projected CRS in metres"),
        ({"vertical_epsg": 5715}, "EPSG:5715 is MSL depth; expected a vertical CRS of heights"),
        ({"vertical_epsg": 32632}, "UTM zone 32N; expected a vertical CRS of heights in metres"),
        ({"origin_deg": (85.0, 0.0)}, "latitude 85 has no UTM zone; expected .* survey_epsg"),
    ],
)
def test_a_crs_that_does_not_fit_is_named(settings, message):
    with pytest.raises(ValueError, match=message):
        Georeference(**{"origin_deg": ORIGIN, **settings})


def test_a_crs_for_elsewhere_is_told():
    assert Georeference(ORIGIN).outside_of_use() == ""
    assert "southern hemisphere" in Georeference(ORIGIN, 32733).outside_of_use()
