"""Exports a run folder: all formats, written aside and then put in place."""

from __future__ import annotations

import os
import tempfile
from functools import cached_property
from pathlib import Path
from typing import Callable

from rbpf_svgp_slam.exports import netcdf_file, raster_files, trajectory_files, vector_files
from rbpf_svgp_slam.charts.chart import Chart, make_chart
from rbpf_svgp_slam.charts.contours import contour_interval_m
from rbpf_svgp_slam.exports.export_files import FILES, remove_export
from rbpf_svgp_slam.exports.export_settings import ExportSettings
from rbpf_svgp_slam.exports.export_summary import metadata_of, summary_of, write_summary
from rbpf_svgp_slam.exports.exported_run import ExportedRun
from rbpf_svgp_slam.charts.georeference import Georeference
from rbpf_svgp_slam.exports.track import Track

#: Is told what has failed, and why.
Failed = Callable[[str, Exception], None]


class Export:
    """What the formats are written from."""

    def __init__(self, run: ExportedRun, settings: ExportSettings) -> None:
        self.run = run
        self.georeference = Georeference(settings.origin_deg, settings.epsg, settings.vertical_epsg)
        self._interval_m = settings.contour_interval_m
        self.track = Track.of(run, self.georeference)
        self.metadata = metadata_of(run, self.georeference)

    @cached_property
    def chart(self) -> Chart:
        """The seabed in the projected CRS."""
        return make_chart(self.run, self.georeference)

    @property
    def contour_interval_m(self) -> float:
        """As it is wanted, or by the range of depths."""
        return self._interval_m or contour_interval_m(self.chart.elevation)


#: For each format of FILES what writes it, into a path of its first file's name.
WRITERS: dict[str, Callable[[Export, Path], None]] = {
    "geotiff": lambda e, path: raster_files.write_geotiff(e.chart, path, e.metadata),
    "bag": lambda e, path: raster_files.write_bag(e.chart, path, e.metadata),
    "netcdf": lambda e, path: netcdf_file.write_netcdf(e.chart, path, e.metadata),
    "xyz": lambda e, path: raster_files.write_xyz(e.chart, path),
    "hillshade": lambda e, path: raster_files.write_hillshade(e.chart, path, e.metadata),
    "density": lambda e, path: raster_files.write_density(e.chart, path, e.metadata),
    "s44": lambda e, path: raster_files.write_s44(e.chart, path, e.metadata),
    "geopackage": lambda e, path: vector_files.write_geopackage(
        e.chart, e.track, path, e.contour_interval_m, e.metadata
    ),
    "tum": lambda e, path: trajectory_files.write_projected_tum(e.track, path),
    "csv": lambda e, path: trajectory_files.write_csv(e.track, path),
    "geojson": lambda e, path: trajectory_files.write_geojson(e.track, path, e.metadata),
    "kml": lambda e, path: trajectory_files.write_kml(e.track, path, e.metadata),
    "sbet": lambda e, path: trajectory_files.write_sbet(e.track, path),
}


def export_run(
    run: ExportedRun, out_dir: Path, settings: ExportSettings, failed: Failed | None = None
) -> list[Path]:
    """Write the formats into out_dir, in place of an earlier export; returns the files.

    Without `failed` the first error ends it, and out_dir is as it was. With it, it is told of each
    format that fails, and the others are written.
    """
    if out_dir.exists() and not out_dir.is_dir():
        raise ValueError(f"{out_dir} is no folder; expected one to write into, or nothing there")
    export = Export(run, settings)
    out_dir.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".export_", dir=out_dir.parent) as name:
        aside = Path(name)
        for form in settings.formats:
            _try(form, lambda: WRITERS[form](export, aside / FILES[form][0]), aside, failed)
        _try("summary", lambda: _write_summary(export, aside), aside, failed)
        return _put_in_place(aside, out_dir)


def _try(form: str, write: Callable[[], None], aside: Path, failed: Failed | None) -> None:
    """One format; whatever goes wrong with it, there is nothing half of it."""
    try:
        write()
    except Exception as error:
        if failed is None:
            raise
        for name in FILES.get(form, ()):
            (aside / name).unlink(missing_ok=True)
        failed(form, error)


def _write_summary(export: Export, folder: Path) -> None:
    exaggeration = raster_files.exaggeration(export.chart)
    summary = summary_of(export.run, export.chart, export.contour_interval_m, exaggeration)
    summary["files"] = sorted(path.name for path in folder.iterdir())
    write_summary(summary, folder)


def _put_in_place(aside: Path, out_dir: Path) -> list[Path]:
    remove_export(out_dir)
    out_dir.mkdir(exist_ok=True)
    written = []
    for path in sorted(aside.iterdir()):
        os.replace(path, out_dir / path.name)
        written.append(out_dir / path.name)
    return written
