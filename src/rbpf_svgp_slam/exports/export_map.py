"""The command line that exports a run folder for charts, GIS and navigation processing."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from rbpf_svgp_slam.charts.georeference import MEAN_SEA_LEVEL, Georeference
from rbpf_svgp_slam.exports.export_files import FILES
from rbpf_svgp_slam.exports.export_run import export_run
from rbpf_svgp_slam.exports.export_settings import export_settings
from rbpf_svgp_slam.exports.export_summary import warnings_of
from rbpf_svgp_slam.exports.exported_run import load_exported_run

_DESCRIPTION = """Write the seabed and the track of a run folder for charts, GIS and navigation
processing: docs/products.md.

The seabed is DIR/seabed.npz, or map.npz where there is none; beams and track are those of the final
trajectory. DIR may be another program's: evaluate_run.py --help tells what it holds. The map frame
is taken for the plane that touches the earth at the survey's origin, x to the east, y to the north,
z up from mean sea level. OUT is written when all of it is there, in place of an earlier export."""


def main(argv: list[str] | None = None) -> int:
    """Run the command; return its exit status: 0 exported, 1 not."""
    arguments = _parse(argv)
    try:
        files = _run(arguments)
    # GDAL's are RuntimeErrors.
    except (ValueError, OSError, RuntimeError) as error:
        text = " ".join(str(error).split())
        print(f"export_map.py: error: {text}", file=sys.stderr)
        return 1
    print(f"{files[0].parent}: {', '.join(path.name for path in files)}")
    return 0


def _parse(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="export_map.py",
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("folder", metavar="DIR", type=Path, help="the run folder")
    add("--out", metavar="OUT", type=Path, help="the folder to write (default: DIR/export)")
    origin = "WGS 84, degrees, of map's origin (default: survey_origin of DIR/parameters.yaml)"
    add("--origin", metavar=("LAT", "LON"), nargs=2, type=float, help=origin)
    epsg = "a projected CRS in metres (default: survey_epsg; 0: the UTM zone of the origin)"
    add("--epsg", metavar="E", type=int, help=epsg)
    vertical = "what z is up from (default: %(default)s, mean sea level)"
    add("--vertical-epsg", metavar="V", type=int, default=MEAN_SEA_LEVEL, help=vertical)
    formats = f"of {', '.join(FILES)} (default: all)"
    add("--formats", metavar="F", nargs="+", default=list(FILES), help=formats)
    contours = "between contours, m (default: 1, 2 or 5 times a power of ten)"
    add("--contour-interval", metavar="M", type=float, help=contours)
    return parser.parse_args(argv)


def _run(arguments: argparse.Namespace) -> list[Path]:
    folder = arguments.folder
    run = load_exported_run(folder)
    settings = export_settings(
        run.config,
        folder,
        origin_deg=arguments.origin,
        epsg=arguments.epsg,
        vertical_epsg=arguments.vertical_epsg,
        formats=arguments.formats,
        contour_interval_m=arguments.contour_interval,
    )
    place = Georeference(settings.origin_deg, settings.epsg, settings.vertical_epsg)
    for warning in warnings_of(place):
        print(f"export_map.py: warning: {warning}", file=sys.stderr)
    return export_run(run, arguments.out or folder / "export", settings)
