"""Exported files, read back by other libraries than those that wrote them."""

import csv
import dataclasses
import json
from xml.etree import ElementTree

import fiona
import h5py
import netCDF4
import numpy as np
import pyproj
import pytest
import rasterio
from made_up_survey import ORIGIN_DEG
from osgeo import gdal
from PIL import Image
from scipy.spatial.transform import Rotation

from rbpf_svgp_slam.charts import s44
from rbpf_svgp_slam.exports.export_files import FILES, SUMMARY
from rbpf_svgp_slam.exports.export_run import WRITERS, Export, export_run
from rbpf_svgp_slam.exports.export_settings import export_settings
from rbpf_svgp_slam.exports.exported_run import load_exported_run
from rbpf_svgp_slam.exports.raster_files import write_geotiff
from rbpf_svgp_slam.exports.track import Track
from rbpf_svgp_slam.exports.trajectory_files import SBET_FIELDS, week_start_s, write_sbet
from rbpf_svgp_slam.run.tracks import read_tum, rotations

MICROMETRE = 1e-6


@pytest.fixture(scope="module")
def export(placed_folder):
    run = load_exported_run(placed_folder)
    return Export(run, export_settings(run.config, placed_folder))


@pytest.fixture(scope="module")
def folder(placed_folder, tmp_path_factory):
    run = load_exported_run(placed_folder)
    out = tmp_path_factory.mktemp("exported") / "export"
    export_run(run, out, export_settings(run.config, placed_folder))
    return out


@pytest.fixture(scope="module")
def summary(folder):
    return json.loads((folder / "summary.json").read_text())


def test_every_format_has_written_its_files(folder):
    assert set(WRITERS) == set(FILES)
    expected = {name for names in (*FILES.values(), SUMMARY) for name in names}
    assert {path.name for path in folder.iterdir()} == expected


def as_float32(layer):
    return layer.astype(np.float32)


# Rasters


def test_geotiff(export, folder):
    chart = export.chart
    with rasterio.open(folder / "seabed.tif") as file:
        assert file.dtypes == ("float32", "float32")
        assert file.descriptions == ("elevation", "standard deviation")
        elevation, std = file.read()
        assert tuple(file.transform)[:6] == (1, 0, chart.west_m, 0, -1, chart.north_m)
        assert file.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
        assert "tide" in file.tags()["uncertainty_lacks"]
        wkt = file.crs.to_wkt()
    np.testing.assert_array_equal(elevation, as_float32(chart.elevation))
    np.testing.assert_array_equal(std, as_float32(chart.std))
    crs = pyproj.CRS.from_wkt(wkt)
    assert crs.is_compound
    assert [part.to_epsg() for part in crs.sub_crs_list] == [32632, 5714]


def test_a_large_geotiff_has_overviews(export, tmp_path):
    zeros = np.zeros((1200, 1500))
    chart = dataclasses.replace(export.chart, elevation=zeros, std=zeros)
    write_geotiff(chart, tmp_path / "large.tif", {})
    with rasterio.open(tmp_path / "large.tif") as file:
        assert file.overviews(1) == [2, 4] and set(file.block_shapes) == {(512, 512)}


def test_bag(export, folder):
    chart = export.chart
    with h5py.File(folder / "seabed.bag") as file:
        root = file["BAG_root"]
        # BAG's first row is the southern one.
        elevation, std = (root[name][:][::-1] for name in ("elevation", "uncertainty"))
        text = b"".join(root["metadata"][:]).decode()
    known = chart.known
    np.testing.assert_array_equal(elevation[known], as_float32(chart.elevation)[known])
    np.testing.assert_array_equal(std[known], as_float32(chart.std)[known])
    assert (elevation[~known] == 1e6).all() and (std[~known] == 1e6).all()
    metadata = ElementTree.fromstring(text)
    crs = [node.text for node in metadata.iter() if "CS[" in (node.text or "")]
    assert len(crs) == 2
    assert [pyproj.CRS.from_wkt(wkt).name for wkt in crs] == [
        "WGS 84 / UTM zone 32N",
        "MSL height",
    ]
    assert "sound speed" in text


def test_bag_lies_where_the_geotiff_does(folder):
    bag, tiff = (gdal.Open(str(folder / f"seabed.{end}")) for end in ("bag", "tif"))
    assert bag.GetGeoTransform() == tiff.GetGeoTransform()
    assert bag.GetSpatialRef().IsCompound()
    assert bag.GetSpatialRef().GetAuthorityCode("COMPD_CS|PROJCS") == "32632"


def test_netcdf(export, folder):
    chart = export.chart
    with netCDF4.Dataset(folder / "seabed.nc") as file:
        file.set_auto_mask(False)
        assert file.Conventions == "CF-1.8" and "tide" in file.uncertainty_lacks
        np.testing.assert_array_equal(file["x"][:], chart.easting)
        np.testing.assert_array_equal(file["y"][:], chart.northing)
        layers = {
            "elevation": chart.elevation,
            "standard_deviation": chart.std,
            "seabed_standard_deviation": chart.seabed_std,
            "position_standard_deviation": chart.position_std,
        }
        for name, layer in layers.items():
            np.testing.assert_array_equal(file[name][:], as_float32(layer))
            assert file[name].units == "m" and file[name].grid_mapping == "crs"
        assert file["elevation"].standard_name == "height_above_mean_sea_level"
        np.testing.assert_array_equal(file["density"][:], chart.surveyed_density)
        assert file["density"]._FillValue == -1
        order = file["s44_order"]
        np.testing.assert_array_equal(order[:], np.where(chart.order == 255, -1, chart.order))
        assert order.flag_meanings.split()[-1] == "order_Exclusive"
        assert len(order.flag_meanings.split()) == len(order.flag_values) == len(s44.NAMES)
        crs = pyproj.CRS.from_cf({k: file["crs"].getncattr(k) for k in file["crs"].ncattrs()})
        assert [part.to_epsg() for part in crs.sub_crs_list] == [32632, 5714]
    raster = gdal.Open(f"NETCDF:{folder}/seabed.nc:elevation")
    geotransform = gdal.Open(str(folder / "seabed.tif")).GetGeoTransform()
    np.testing.assert_allclose(raster.GetGeoTransform(), geotransform)


def test_xyz(export, folder):
    table, chart = np.loadtxt(folder / "seabed.xyz"), export.chart
    assert table.shape == (chart.known.sum(), 4)
    column = (table[:, 0] - chart.west_m - 0.5).astype(int)
    row = (chart.north_m - table[:, 1] - 0.5).astype(int)
    np.testing.assert_allclose(table[:, 2], chart.elevation[row, column], atol=5.01e-4)
    np.testing.assert_allclose(table[:, 3], chart.std[row, column], atol=5.01e-4)


def test_density_and_orders(export, folder):
    with rasterio.open(folder / "density.tif") as file:
        assert file.dtypes == ("int32",) and file.crs.to_epsg() == 32632
        soundings = file.read(1, masked=True)
    known = export.chart.known
    np.testing.assert_array_equal(soundings.filled(0), export.chart.density)
    # Gaps between soundings are known to be gaps; where no beam fell, nothing is.
    assert not soundings.mask[known].any() and (soundings[known] == 0).any()
    np.testing.assert_array_equal(soundings.mask, ~known & (export.chart.density == 0))
    # Some lie beyond the map.
    assert 0.99 * len(export.run.beams) < export.chart.density.sum() < len(export.run.beams)
    with rasterio.open(folder / "s44_order.tif") as file:
        assert file.dtypes == ("uint8",) and file.nodata == s44.UNKNOWN
        np.testing.assert_array_equal(file.read(1), export.chart.order)
        assert "4: Exclusive" in file.tags()["codes"]


def test_hillshade(export, folder):
    shade, opaque = np.moveaxis(np.asarray(Image.open(folder / "hillshade.png")), -1, 0)
    np.testing.assert_array_equal(opaque > 0, export.chart.known)
    # Relief, neither black nor white nor all the same.
    light = shade[export.chart.known]
    assert 100 < np.median(light) < 230 and 15 < light.std() < 90
    with rasterio.open(folder / "hillshade.png") as file:
        assert file.crs.to_epsg() == 32632
        assert (file.transform.c, file.transform.f) == (export.chart.west_m, export.chart.north_m)


# Contours and lines


def test_contours(export, folder, summary):
    chart = export.chart
    with fiona.open(folder / "survey.gpkg", layer="contours") as layer:
        assert layer.crs == {"init": "epsg:32632"}
        features = [(f["properties"]["elevation_m"], f["geometry"]) for f in layer]
    elevations = np.unique([elevation for elevation, _ in features])
    interval_m = summary["contour_interval_m"]
    np.testing.assert_allclose(elevations / interval_m, np.rint(elevations / interval_m))
    assert 8 < len(elevations) <= 20
    steepest = max(np.nanmax(np.abs(np.diff(chart.elevation, axis=axis))) for axis in (0, 1))
    for elevation, geometry in features:
        easting, northing = np.array(geometry["coordinates"]).T[:2]
        column, row = (easting - chart.west_m - 0.5), (chart.north_m - northing - 0.5)
        near = chart.elevation[np.rint(row).astype(int), np.rint(column).astype(int)]
        # A contour passes half a cell from the nearest centre, at most, along either axis.
        assert np.nanmax(np.abs(near - elevation), initial=0) <= steepest + 1e-9


def test_survey_lines(export, folder):
    with fiona.open(folder / "survey.gpkg", layer="survey_lines") as layer:
        lines = list(layer)
    # Of the lawn mower, made_up_survey.py.
    assert [f["properties"]["line"] for f in lines] == [1, 2, 3, 4, 5, 6]
    assert sum(f["properties"]["pings"] for f in lines) == len(export.track.stamp_s)
    vertices = np.vstack([f["geometry"]["coordinates"] for f in lines])
    np.testing.assert_allclose(vertices, export.track.projected_poses[:, :2], atol=MICROMETRE)
    assert lines[0]["properties"]["start_utc"] == "2020-09-13T12:26:40.000000Z"
    # 100 m and a half circle of 10 m across, wandering by 0.5 m.
    assert lines[0]["properties"]["length_m"] == pytest.approx(110, rel=0.1)


# Trajectory


def placed_anew(latitude_deg, longitude_deg):
    """x, y in map, by the closed form of the plane that touches the ellipsoid at the origin."""
    ecef = pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
    points = np.array(ecef.transform(longitude_deg, latitude_deg, np.zeros(len(latitude_deg))))
    origin = np.array(ecef.transform(ORIGIN_DEG[1], ORIGIN_DEG[0], 0.0))
    phi, lam = np.deg2rad(ORIGIN_DEG)
    east = [-np.sin(lam), np.cos(lam), 0]
    north = [-np.sin(phi) * np.cos(lam), -np.sin(phi) * np.sin(lam), np.cos(phi)]
    return (np.array([east, north]) @ (points - origin[:, None])).T


def test_tum(export, folder):
    stamp_s, poses = read_tum(folder / "trajectory.tum")
    track = export.track
    np.testing.assert_allclose(stamp_s, track.stamp_s, atol=MICROMETRE)
    np.testing.assert_allclose(poses[:, 2:5], track.poses[:, 2:5], atol=1e-8)
    # Ahead of the vehicle in map is ahead of it in the grid.
    yaw = track.poses[:, 5]
    ahead = track.poses[:, :2] + 10 * np.column_stack([np.cos(yaw), np.sin(yaw)])
    moved = track.georeference.projected(ahead) - poses[:, :2]
    np.testing.assert_allclose(np.arctan2(*moved.T[::-1]), poses[:, 5], atol=1e-6)


def test_csv(export, folder):
    with open(folder / "trajectory.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    column = {name: [row[name] for row in rows] for name in rows[0]}
    number = {name: np.array(v, float) for name, v in column.items() if name != "utc"}
    xy = placed_anew(number["latitude_deg"], number["longitude_deg"])
    np.testing.assert_allclose(xy, export.track.poses[:, :2], atol=2e-5)  # 1e-10 degrees
    assert column["utc"][1] == "2020-09-13T12:26:40.500000Z"
    heading = (90 - np.rad2deg(export.track.poses[:, 5])) % 360
    # Over 100 m true north turns by 1e-3 degrees.
    difference = (number["heading_deg"] - heading + 180) % 360 - 180
    assert np.abs(difference).max() < 2e-3
    # The variances of two axes turned together keep their sum and their determinant.
    ee, en, nn = (
        number[name]
        for name in ("easting_variance_m2", "easting_northing_m2", "northing_variance_m2")
    )
    xx, xy, _, yy, _, yaw = export.track.covariance.T
    np.testing.assert_allclose(ee + nn, xx + yy, rtol=1e-8)
    np.testing.assert_allclose(ee * nn - en**2, xx * yy - xy**2, rtol=1e-6)
    np.testing.assert_allclose(number["yaw_variance_rad2"], yaw, rtol=1e-8)
    turn = export.georeference.turn_to_grid_rad(np.zeros((1, 2)))[0]
    cos, sin = np.cos(turn), np.sin(turn)
    np.testing.assert_allclose(ee, cos**2 * xx - 2 * cos * sin * xy + sin**2 * yy, rtol=1e-4)


def test_geojson(export, folder):
    with fiona.open(folder / "trajectory.geojson") as layer:
        (feature,) = list(layer)
    longitude, latitude = np.array(feature["geometry"]["coordinates"]).T
    xy = placed_anew(latitude, longitude)
    # GDAL's reader keeps what it finds; the file has ten decimals of a degree.
    np.testing.assert_allclose(xy, export.track.poses[:, :2], atol=2e-5)
    properties = json.loads((folder / "trajectory.geojson").read_text())["features"][0][
        "properties"
    ]
    assert properties["coordTimes"] == export.track.utc
    np.testing.assert_allclose(properties["z_m"], -10)


def test_kml(export, folder):
    root = ElementTree.parse(folder / "trajectory.kml")
    names = {"k": "http://www.opengis.net/kml/2.2"}
    text = root.find(".//k:LineString/k:coordinates", names).text
    places = np.array([point.split(",") for point in text.split()], float)
    np.testing.assert_allclose(
        placed_anew(*places[:, 1::-1].T), export.track.poses[:, :2], atol=2e-5
    )
    np.testing.assert_allclose(places[:, 2], -10)
    assert root.find(".//k:TimeSpan/k:begin", names).text == export.track.utc[0]
    assert gdal.OpenEx(str(folder / "trajectory.kml"), gdal.OF_VECTOR).GetLayerCount() == 1


def test_sbet(export, folder):
    dtype = np.dtype([(name, "<f8") for name in SBET_FIELDS])
    assert dtype.itemsize == 136
    records = np.fromfile(folder / "trajectory.sbet", dtype)
    assert len(records) == len(export.track.stamp_s)
    # 13 September 2020, 12:26:40 UTC, was a Sunday.
    seconds = 12 * 3600 + 26 * 60 + 40
    np.testing.assert_allclose(records["time_s"], seconds + 0.5 * np.arange(len(records)))
    xy = placed_anew(*np.rad2deg([records["latitude_rad"], records["longitude_rad"]]))
    np.testing.assert_allclose(xy, export.track.poses[:, :2], atol=MICROMETRE)
    np.testing.assert_allclose(records["altitude_m"], export.track.poses[:, 2])
    zero = [name for name in SBET_FIELDS if not records[name].any()]
    expected = {"wander_rad"} | {
        n for n in SBET_FIELDS if "veloc" in n or "acc" in n or "rate" in n
    }
    assert expected <= set(zero)


def test_sbets_attitude_is_that_of_the_vehicle_in_north_east_down(export, tmp_path):
    poses = np.random.default_rng(1).uniform(-1, 1, (20, 6)) * [0, 0, 0, 0.8, 0.8, 3]
    track = Track(export.georeference, 1.6e9 + np.arange(20.0), poses, None)
    path = tmp_path / "attitude.sbet"
    write_sbet(track, path)
    roll, pitch, heading = np.fromfile(path).reshape(20, 17).T[7:10]
    down = Rotation.from_euler("ZYX", np.column_stack([heading, pitch, roll])).as_matrix()
    # East-north-up into north-east-down, and forward-left-up into forward-right-down.
    earth, body = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]]), np.diag([1, -1, -1])
    np.testing.assert_allclose(down, earth @ rotations(poses).as_matrix() @ body, atol=1e-7)


def test_weeks_begin_on_sundays():
    sunday = np.datetime64("2023-11-12T00:00:00").astype(float)
    for late_s in (0.0, 1.0, 7 * 86400 - 0.5):
        assert week_start_s(sunday + late_s) == sunday


# Summary


def test_summary(export, folder, summary):
    chart = export.chart
    assert summary["survey_origin"] == ORIGIN_DEG and summary["crs"]["epsg"] == 32632
    assert summary["known_cells"] == chart.known.sum() and summary["seabed"] == "seabed.npz"
    assert summary["soundings"] == chart.density.sum()
    assert sum(summary["s44_order_shares"].values()) == pytest.approx(1)
    assert summary["std_m"]["median"] > summary["noise_std_m"] > 0
    page = (folder / "summary.md").read_text()
    assert "| Exclusive | " in page and "feature detection" in page and "Not in it: tide" in page
    assert set(summary["files"]) | set(SUMMARY) == {path.name for path in folder.iterdir()}
