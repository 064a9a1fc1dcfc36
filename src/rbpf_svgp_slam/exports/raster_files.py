"""GeoTIFF, BAG, XYZ and hillshade of a chart, its sounding density and its S-44 orders."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from osgeo import gdal

from rbpf_svgp_slam.charts import s44
from rbpf_svgp_slam.charts.chart import NO_DENSITY, Chart
from rbpf_svgp_slam.exports.gdal_rasters import Band, copied, in_memory
from rbpf_svgp_slam.run.run_files import RunFolderError

# BAG's own.
_BAG_UNKNOWN = 1.0e6
# Of the slopes 95 % are shaded as less than 1 in 2; but no flat seabed's noise as mountains.
_STEEP_PERCENTILE, _STEEP_SLOPE, _LARGEST_EXAGGERATION = 95, 0.5, 20.0
_CONTINUOUS = {
    "COMPRESS": "DEFLATE",
    "PREDICTOR": "YES",
    "RESAMPLING": "AVERAGE",
    "OVERVIEW_RESAMPLING": "AVERAGE",
}
_DISCRETE = {"COMPRESS": "DEFLATE", "RESAMPLING": "NEAREST", "OVERVIEW_RESAMPLING": "NEAREST"}


def write_geotiff(chart: Chart, path: Path, metadata: dict[str, str]) -> None:
    """Cloud-optimised: elevation and its standard deviation, float32 m."""
    bands = [
        Band("elevation", chart.elevation, np.nan, unit="m"),
        Band("standard deviation", chart.std, np.nan, unit="m"),
    ]
    copied(in_memory(chart, bands, metadata), "COG", path, _CONTINUOUS)


def write_bag(chart: Chart, path: Path, metadata: dict[str, str]) -> None:
    """Bathymetric Attributed Grid of elevation and uncertainty, float32 m."""
    bands = [
        Band("elevation", chart.elevation, _BAG_UNKNOWN),
        Band("uncertainty", chart.std, _BAG_UNKNOWN),
    ]
    options = {
        # A code of the format's for each kind of uncertainty; none is ours, which the text tells.
        "VAR_VERTICAL_UNCERT_CODE": "unknown",
        "VAR_ABSTRACT": " ".join(metadata.values()),
        "VAR_PROCESS_STEP_DESCRIPTION": "SLAM and gridding by rbpf_svgp_slam",
    }
    copied(in_memory(chart, bands, {}), "BAG", path, options)


def write_density(chart: Chart, path: Path, metadata: dict[str, str]) -> None:
    """Cloud-optimised GeoTIFF: beams in each cell, int32; NO_DENSITY off the survey."""
    bands = [Band("soundings", chart.surveyed_density, NO_DENSITY, gdal.GDT_Int32)]
    copied(in_memory(chart, bands, metadata, heights=False), "COG", path, _DISCRETE)


def write_s44(chart: Chart, path: Path, metadata: dict[str, str]) -> None:
    """Cloud-optimised GeoTIFF: codes of S-44's orders, uint8, with their names as categories."""
    names = [f"order {name}" for _, name in sorted(s44.NAMES.items())]
    codes = ", ".join(f"{code}: {name}" for code, name in sorted(s44.NAMES.items()))
    metadata = {**metadata, "codes": f"orders by vertical uncertainty alone; {codes}"}
    bands = [Band("S-44 order", chart.order, s44.UNKNOWN, gdal.GDT_Byte, categories=names)]
    copied(in_memory(chart, bands, metadata, heights=False), "COG", path, _DISCRETE)


def write_xyz(chart: Chart, path: Path) -> None:
    """Text, a line for each known cell: easting, northing, elevation, standard deviation, m."""
    row, column = np.nonzero(chart.known)
    table = [
        chart.easting[column],
        chart.northing[row],
        chart.elevation[row, column],
        chart.std[row, column],
    ]
    np.savetxt(path, np.column_stack(table), fmt="%.3f")


def write_hillshade(chart: Chart, path: Path, metadata: dict[str, str]) -> None:
    """Grey PNG lit from several sides, transparent where no beam fell, with its place beside it."""
    elevation = in_memory(chart, [Band("elevation", chart.elevation, -9999.0)], {})
    shaded = gdal.DEMProcessing(
        "",
        elevation,
        "hillshade",
        format="MEM",
        zFactor=exaggeration(chart),
        multiDirectional=True,
        computeEdges=True,
    )
    if shaded is None:
        raise RunFolderError(f"{path}: GDAL has made no hillshade of the elevations")
    grey = Band("shade", shaded.ReadAsArray(), None, gdal.GDT_Byte)
    opaque = Band("opaque", np.where(chart.known, 255, 0).astype(np.uint8), None, gdal.GDT_Byte)
    picture = in_memory(chart, [grey, opaque], metadata, heights=False)
    picture.GetRasterBand(2).SetColorInterpretation(gdal.GCI_AlphaBand)
    copied(picture, "PNG", path, {"WORLDFILE": "YES"})


def exaggeration(chart: Chart) -> float:
    """What the hillshade multiplies heights with."""
    down, right = (
        np.abs(np.diff(chart.elevation, axis=axis)) / chart.resolution_m for axis in (0, 1)
    )
    slope = np.concatenate([down[np.isfinite(down)], right[np.isfinite(right)]])
    steep = np.percentile(slope, _STEEP_PERCENTILE) if len(slope) else 0.0
    return float(np.clip(_STEEP_SLOPE / max(steep, 1e-9), 1.0, _LARGEST_EXAGGERATION))
