"""What an export consists of: the names of its formats, and of the files that each writes."""

from __future__ import annotations

from pathlib import Path

FILES = {
    "geotiff": ("seabed.tif",),
    "bag": ("seabed.bag",),
    "netcdf": ("seabed.nc",),
    "xyz": ("seabed.xyz",),
    "hillshade": ("hillshade.png", "hillshade.wld", "hillshade.png.aux.xml"),
    "density": ("density.tif",),
    "s44": ("s44_order.tif", "s44_order.tif.aux.xml"),
    "geopackage": ("survey.gpkg",),
    "tum": ("trajectory.tum",),
    "csv": ("trajectory.csv",),
    "geojson": ("trajectory.geojson",),
    "kml": ("trajectory.kml",),
    "sbet": ("trajectory.sbet",),
}
#: Beside whatever formats.
SUMMARY = ("summary.json", "summary.md")


def remove_export(out_dir: Path) -> None:
    """Take away what an export has written, and the folder if nothing else is in it."""
    for names in (*FILES.values(), SUMMARY):
        for name in names:
            (out_dir / name).unlink(missing_ok=True)
    if out_dir.is_dir() and not any(out_dir.iterdir()):
        out_dir.rmdir()
