"""The export at the end of a run, which may fail, but must not cost anything else."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Callable

from rbpf_svgp_slam.exports.export_files import remove_export


def export_after_run(
    folder: Path, config: dict[str, Any], complain: Callable[[str], None]
) -> list[Path]:
    """Write folder/export if the run has an origin; returns the files.

    config: its parameters; complain: is told of each failure in a line.
    """
    out_dir = folder / "export"

    def failed(what: str, error: Exception) -> None:
        reason = " ".join(str(error).split()) or type(error).__name__
        complain(f"No {what} in {out_dir}: {reason}. To try again: export_map.py {folder}")

    # Whatever it is: a library that is not there, a disk that is full, a CRS that is none.
    try:
        remove_export(out_dir)  # of an earlier run
        if not config.get("survey_origin"):
            return []
        # Here, since GDAL is of no use to a run without an origin.
        from rbpf_svgp_slam.exports.export_run import export_run
        from rbpf_svgp_slam.exports.export_settings import export_settings
        from rbpf_svgp_slam.exports.exported_run import load_exported_run

        settings = export_settings(config, folder)
        return export_run(load_exported_run(folder), out_dir, settings, failed)
    except Exception as error:
        failed("export", error)
        return []
