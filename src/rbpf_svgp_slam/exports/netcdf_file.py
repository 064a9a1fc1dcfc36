"""A chart as netCDF by the CF conventions, with all its layers.

Written by scipy, in netCDF's classic format with 64-bit offsets, which every reader knows.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyproj
from scipy.io import netcdf_file

from rbpf_svgp_slam.charts import s44
from rbpf_svgp_slam.charts.georeference import MEAN_SEA_LEVEL
from rbpf_svgp_slam.charts.chart import NO_DENSITY, Chart

_ABOVE_SEA = "height_above_mean_sea_level"
_UNKNOWN_ORDER = -1  # the classic format has no unsigned bytes


def write_netcdf(chart: Chart, path: Path, metadata: dict[str, str]) -> None:
    """Elevation, its standard deviation and both shares of it, sounding density, S-44's orders."""
    with netcdf_file(str(path), "w", version=2) as file:
        file.Conventions = b"CF-1.8"
        for name, text in metadata.items():
            setattr(file, name, text.encode())
        _axes(file, chart)
        _reference(file, chart)
        for name, (values, attributes) in _layers(chart).items():
            variable = file.createVariable(name, values.dtype.newbyteorder(">"), ("y", "x"))
            variable[:] = values
            if np.issubdtype(values.dtype, np.floating):
                attributes = {"_FillValue": np.float32(np.nan), "units": "m", **attributes}
            _describe(variable, {**attributes, "grid_mapping": "crs"})


def _axes(file: netcdf_file, chart: Chart) -> None:
    axes = {"y": (chart.northing, "northing"), "x": (chart.easting, "easting")}
    for name, (values, long_name) in axes.items():
        file.createDimension(name, len(values))
        variable = file.createVariable(name, ">f8", (name,))
        variable[:] = values
        standard_name = f"projection_{name}_coordinate"
        _describe(
            variable,
            {"standard_name": standard_name, "long_name": long_name, "units": "m"},
        )


def _reference(file: netcdf_file, chart: Chart) -> None:
    variable = file.createVariable("crs", ">i4", ())
    variable.assignValue(0)
    crs = pyproj.CRS.from_user_input(chart.georeference.compound)
    horizontal = pyproj.CRS.from_epsg(chart.georeference.epsg)
    # spatial_ref is what GDAL looks for.
    _describe(
        variable,
        {**horizontal.to_cf(), "crs_wkt": crs.to_wkt(), "spatial_ref": crs.to_wkt("WKT1_GDAL")},
    )


def _layers(chart: Chart) -> dict[str, tuple[np.ndarray, dict[str, Any]]]:
    """Of each variable: its values, and what is said of them."""
    elevation = {
        "long_name": f"seabed, up, by {chart.georeference.vertical_name}",
        "ancillary_variables": "standard_deviation density s44_order",
    }
    std = {"long_name": "standard deviation of a depth, all shares together"}
    if chart.georeference.vertical_epsg == MEAN_SEA_LEVEL:
        elevation["standard_name"] = _ABOVE_SEA
        std["standard_name"] = f"{_ABOVE_SEA} standard_error"
    order = np.where(chart.order == s44.UNKNOWN, _UNKNOWN_ORDER, chart.order).astype(np.int8)
    names = [f"order_{s44.NAMES[code]}".replace(", ", "_") for code in sorted(s44.NAMES)]
    return {
        "elevation": (chart.elevation.astype(np.float32), elevation),
        "standard_deviation": (chart.std.astype(np.float32), std),
        "seabed_standard_deviation": (
            chart.seabed_std.astype(np.float32),
            {"long_name": "standard deviation of the seabed's mean"},
        ),
        "position_standard_deviation": (
            chart.position_std.astype(np.float32),
            {"long_name": "of a depth, what the trajectory's uncertainty gives"},
        ),
        "density": (
            chart.surveyed_density,
            {
                "long_name": "soundings in the cell",
                "units": "1",
                "_FillValue": np.int32(NO_DENSITY),
            },
        ),
        "s44_order": (
            order,
            {
                "long_name": "order of IHO S-44 met, by vertical uncertainty alone",
                "_FillValue": np.int8(_UNKNOWN_ORDER),
                "flag_values": np.arange(len(names), dtype=np.int8),
                "flag_meanings": " ".join(names),
            },
        ),
    }


def _describe(variable: Any, attributes: dict[str, Any]) -> None:
    for name, value in attributes.items():
        if value is not None:
            setattr(variable, name, value.encode() if isinstance(value, str) else value)
