"""Charts as GDAL's rasters: in memory first, then copied into a file."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Sequence

import numpy as np
from osgeo import gdal, osr

from rbpf_svgp_slam.charts.chart import Chart

gdal.UseExceptions()
osr.UseExceptions()


@dataclass(frozen=True)
class Band:
    """A layer [rows, columns] of a raster."""

    name: str
    values: np.ndarray
    nodata: float | None
    kind: int = gdal.GDT_Float32
    unit: str = ""
    categories: Sequence[str] = field(default=())


def reference_system(name: str) -> osr.SpatialReference:
    """Of an `EPSG:…` name; positions are written easting first, whatever the CRS's own order."""
    system = osr.SpatialReference()
    system.SetFromUserInput(name)
    system.SetAxisMappingStrategy(osr.OAMS_TRADITIONAL_GIS_ORDER)
    return system


def in_memory(
    chart: Chart, bands: Sequence[Band], metadata: dict[str, str], heights: bool = True
) -> gdal.Dataset:
    """A raster of the chart's grid, north up. Its CRS is compound where the bands hold heights."""
    rows, columns = chart.elevation.shape
    raster = gdal.GetDriverByName("MEM").Create("", columns, rows, len(bands), bands[0].kind)
    raster.SetGeoTransform(
        (chart.west_m, chart.resolution_m, 0.0, chart.north_m, 0.0, -chart.resolution_m)
    )
    georeference = chart.georeference
    crs = georeference.compound if heights else f"EPSG:{georeference.epsg}"
    raster.SetSpatialRef(reference_system(crs))
    raster.SetMetadata(metadata)
    for number, band in enumerate(bands, start=1):
        target = raster.GetRasterBand(number)
        target.SetDescription(band.name)
        values = np.asarray(band.values)
        if band.nodata is not None:
            target.SetNoDataValue(band.nodata)
            if np.issubdtype(values.dtype, np.floating):
                values = np.where(np.isnan(values), band.nodata, values)
        if band.unit:
            target.SetUnitType(band.unit)
        if band.categories:
            target.SetCategoryNames(list(band.categories))
        target.WriteArray(values)
    return raster


def copied(raster: gdal.Dataset, driver: str, path: Path, options: dict[str, object]) -> None:
    """Write a raster by one of GDAL's drivers."""
    texts = [f"{name}={value}" for name, value in options.items()]
    written = gdal.GetDriverByName(driver).CreateCopy(str(path), raster, options=texts)
    written.FlushCache()
    del written  # which closes it
