"""The final trajectory as TUM, CSV, GeoJSON, KML, and SBET-like navigation for reprocessing."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from rbpf_svgp_slam.exports.track import Track
from rbpf_svgp_slam.run.tracks import write_tum

_KML = "http://www.opengis.net/kml/2.2"
_WEEK_S = 7 * 86400
# 1 January 1970 was a Thursday; weeks begin on Sundays.
_FIRST_SUNDAY_S = 3 * 86400
#: Doubles of an SBET record.
SBET_FIELDS = (
    "time_s latitude_rad longitude_rad altitude_m x_velocity_mps y_velocity_mps z_velocity_mps "
    "roll_rad pitch_rad heading_rad wander_rad x_acceleration_mps2 y_acceleration_mps2 "
    "z_acceleration_mps2 x_rate_radps y_rate_radps z_rate_radps"
).split()
_POSE = (
    "stamp_s utc latitude_deg longitude_deg easting_m northing_m z_m roll_rad pitch_rad "
    "grid_yaw_rad heading_deg"
)
_COVARIANCE = (
    "easting_variance_m2 easting_northing_m2 easting_yaw_mrad northing_variance_m2 "
    "northing_yaw_mrad yaw_variance_rad2"
)


def write_projected_tum(track: Track, path: Path) -> None:
    """stamp, easting, northing, z, attitude against the grid's axes."""
    write_tum(path, track.stamp_s, track.projected_poses)


def write_csv(track: Track, path: Path) -> None:
    """One line a ping, with the covariance where the run has one."""
    covariance = track.projected_covariance
    names = _POSE.split() + (_COVARIANCE.split() if covariance is not None else [])
    numbers = {
        "%.6f": track.stamp_s[:, None],
        "%.10f": track.places_deg,
        "%.4f": track.projected_poses[:, :3],
        "%.8f": np.column_stack([track.projected_poses[:, 3:], np.rad2deg(track.heading_rad)]),
    }
    if covariance is not None:
        numbers["%.9e"] = covariance
    formats = [form for form, values in numbers.items() for _ in range(values.shape[1])]
    formats.insert(1, "%s")
    rows = np.column_stack(list(numbers.values())).tolist()
    line = ",".join(formats)
    lines = [line % (row[0], utc, *row[1:]) for row, utc in zip(rows, track.utc)]
    path.write_text("\n".join([",".join(names), *lines]) + "\n", encoding="utf-8")


def write_geojson(track: Track, path: Path, metadata: dict[str, str]) -> None:
    """RFC 7946: one line of longitudes and latitudes; heights beside it, since theirs would have to
    be the ellipsoid's."""
    longitude_latitude = np.round(track.places_deg[:, ::-1], 10).tolist()
    feature = {
        "type": "Feature",
        "geometry": {"type": "LineString", "coordinates": longitude_latitude},
        "properties": {
            **metadata,
            "coordTimes": track.utc,
            "z_m": np.round(track.poses[:, 2], 4).tolist(),
            "heading_deg": np.round(np.rad2deg(track.heading_rad), 6).tolist(),
        },
    }
    text = json.dumps({"type": "FeatureCollection", "features": [feature]}, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")


def write_kml(track: Track, path: Path, metadata: dict[str, str]) -> None:
    """One line in the sea, with the survey's span of time."""
    ElementTree.register_namespace("", _KML)
    root = ElementTree.Element(f"{{{_KML}}}kml")
    document = _add(root, "Document")
    _add(document, "name", metadata["title"])
    mark = _add(document, "Placemark")
    _add(mark, "name", "trajectory")
    _add(mark, "description", " ".join(metadata.values()))
    span = _add(mark, "TimeSpan")
    _add(span, "begin", track.utc[0])
    _add(span, "end", track.utc[-1])
    line = _add(mark, "LineString")
    _add(line, "altitudeMode", "absolute")
    points = zip(*track.places_deg.T, track.poses[:, 2])
    text = " ".join(f"{lon:.10f},{lat:.10f},{z:.4f}" for lat, lon, z in points)
    _add(line, "coordinates", text)
    ElementTree.ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)


def write_sbet(track: Track, path: Path) -> None:
    """Records of 17 little-endian doubles, as SBET_FIELDS; of base_link.

    Time in seconds of the first ping's week, UTC, counted on past its end; altitude is z in map.
    Roll is positive with the starboard side down, pitch with the bow up, heading clockwise from
    true north. Velocities, wander angle, accelerations and rates are 0.
    """
    records = np.zeros((len(track.stamp_s), len(SBET_FIELDS)), "<f8")
    records[:, 0] = track.stamp_s - week_start_s(track.stamp_s[0])
    records[:, 1:3] = np.deg2rad(track.places_deg)
    records[:, 3] = track.poses[:, 2]
    # REP 103 has y to the left and z up: the roll is the same, the pitch has the other sign.
    records[:, 7], records[:, 8] = track.poses[:, 3], -track.poses[:, 4]
    records[:, 9] = track.heading_rad
    path.write_bytes(records.tobytes())


def week_start_s(stamp_s: float) -> float:
    """UNIX time of the Sunday, 0 h UTC, at which the week of a time began."""
    return (stamp_s - _FIRST_SUNDAY_S) // _WEEK_S * _WEEK_S + _FIRST_SUNDAY_S


def _add(parent: ElementTree.Element, name: str, text: str | None = None) -> ElementTree.Element:
    element = ElementTree.SubElement(parent, f"{{{_KML}}}{name}")
    element.text = text
    return element
