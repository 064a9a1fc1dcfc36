"""Contours and survey lines as a GeoPackage."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from osgeo import gdal, ogr

from rbpf_svgp_slam.charts.chart import Chart
from rbpf_svgp_slam.exports.gdal_rasters import Band, in_memory, reference_system
from rbpf_svgp_slam.exports.track import Track
from rbpf_svgp_slam.metrics.consistency import survey_lines

_UNKNOWN = -99999.0


def write_geopackage(
    chart: Chart, track: Track, path: Path, interval_m: float, metadata: dict[str, str]
) -> None:
    """Layers `contours` and `survey_lines`, in the projected CRS."""
    system = reference_system(f"EPSG:{chart.georeference.epsg}")
    package = ogr.GetDriverByName("GPKG").CreateDataSource(str(path))
    package.SetMetadata(metadata)
    contours = package.CreateLayer("contours", system, ogr.wkbLineString)
    contours.CreateField(ogr.FieldDefn("contour", ogr.OFTInteger))
    contours.CreateField(ogr.FieldDefn("elevation_m", ogr.OFTReal))
    raster = in_memory(chart, [Band("elevation", chart.elevation, _UNKNOWN)], {})
    options = [f"LEVEL_INTERVAL={interval_m}", f"NODATA={_UNKNOWN}", "ID_FIELD=0", "ELEV_FIELD=1"]
    package.StartTransaction()
    gdal.ContourGenerateEx(raster.GetRasterBand(1), contours, options=options)
    _write_lines(package.CreateLayer("survey_lines", system, ogr.wkbLineString), track)
    package.CommitTransaction()
    del contours, package  # which closes them


def _write_lines(layer: ogr.Layer, track: Track) -> None:
    """A feature for each line, the turn after it included."""
    fields = {
        "line": ogr.OFTInteger,
        "start_utc": ogr.OFTString,
        "end_utc": ogr.OFTString,
        "pings": ogr.OFTInteger,
        "length_m": ogr.OFTReal,
    }
    for name, kind in fields.items():
        layer.CreateField(ogr.FieldDefn(name, kind))
    lines = survey_lines(track.poses[:, 5])
    for number in np.unique(lines):
        pings = np.flatnonzero(lines == number)
        en = track.projected_poses[pings, :2]
        feature = ogr.Feature(layer.GetLayerDefn())
        line = ogr.Geometry(ogr.wkbLineString)
        for easting, northing in en:
            line.AddPoint_2D(easting, northing)
        feature.SetGeometry(line)
        feature.SetField("line", int(number) + 1)
        feature.SetField("start_utc", track.utc[pings[0]])
        feature.SetField("end_utc", track.utc[pings[-1]])
        feature.SetField("pings", len(pings))
        feature.SetField("length_m", float(np.linalg.norm(np.diff(en, axis=0), axis=1).sum()))
        layer.CreateFeature(feature)
