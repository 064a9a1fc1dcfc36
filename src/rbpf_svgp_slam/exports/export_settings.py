"""What an export is told: the survey's place on the earth, its formats, its contours."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Sequence

from rbpf_svgp_slam.charts.georeference import MEAN_SEA_LEVEL
from rbpf_svgp_slam.exports.export_files import FILES
from rbpf_svgp_slam.parameters.rules import Rule, checked, epsg_code, place, positive


@dataclass(frozen=True)
class ExportSettings:
    """Checked by export_settings()."""

    origin_deg: tuple[float, float]  # latitude, longitude of map's origin, WGS 84
    epsg: int  # of a projected CRS; 0: the UTM zone of the origin
    vertical_epsg: int
    formats: tuple[str, ...]
    contour_interval_m: float | None  # None: by the range of depths


def export_settings(
    config: dict[str, Any],
    folder: Path,
    origin_deg: Sequence[float] | None = None,
    epsg: int | None = None,
    vertical_epsg: int = MEAN_SEA_LEVEL,
    formats: Sequence[str] = tuple(FILES),
    contour_interval_m: float | None = None,
) -> ExportSettings:
    """Settings of a run with parameters `config`; what is given here counts more than they do.

    Raises ValueError, which ParameterError is, with the option or parameter, its value and what was
    expected.
    """
    where = f"{folder}/parameters.yaml: "
    if origin_deg is not None:
        origin_deg = checked("--origin", list(origin_deg), place())
    else:
        origin_deg = checked(f"{where}survey_origin", config.get("survey_origin", []), place())
    if not origin_deg:
        raise ValueError(
            f"{folder} has no origin; expected where on the earth its map frame lies: "
            "--origin LAT LON, or the parameter survey_origin"
        )
    if epsg is not None:
        epsg = checked("--epsg", epsg, epsg_code())
    else:
        epsg = checked(f"{where}survey_epsg", config.get("survey_epsg", 0), epsg_code())
    for name in formats:
        checked("--formats", name, Rule(f"some of {', '.join(FILES)}", FILES.__contains__))
    if contour_interval_m is not None:
        checked("--contour-interval", contour_interval_m, positive())
    return ExportSettings(origin_deg, epsg, vertical_epsg, tuple(formats), contour_interval_m)
