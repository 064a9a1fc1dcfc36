"""What a hydrographer asks of a survey: where, how large, how deep, how dense, how sure."""

from __future__ import annotations

from typing import Any

import numpy as np

from rbpf_svgp_slam.charts import s44
from rbpf_svgp_slam.charts.charted_seabed import ChartedSeabed, beams_per_cell, charted_seabed
from rbpf_svgp_slam.charts.georeference import georeference_of
from rbpf_svgp_slam.charts.uncertainty import total_variance
from rbpf_svgp_slam.metrics.metric_names import SURVEY_METRICS
from rbpf_svgp_slam.run.survey_run import SurveyRun


def survey_metrics(run: SurveyRun, notes: list[str]) -> dict[str, Any]:
    """Return the report's numbers about the survey; None where they are not known.

    Areas and densities are of the plane that touches the earth at the origin: on the ground.
    """
    metrics: dict[str, Any] = {**dict.fromkeys(SURVEY_METRICS), "s44_order_shares": None}
    metrics["track_length_m"] = track_length_m(run.estimate)
    seabed = charted_seabed(run)
    if seabed is not None:
        metrics.update(_seabed_metrics(seabed))
    return {**metrics, **_reference(run, notes)}


def track_length_m(poses: np.ndarray) -> float | None:
    """Horizontal length of the way through the known ones of poses [P, 6]; None without two."""
    known = poses[np.isfinite(poses[:, :2]).all(axis=1), :2]
    return float(np.linalg.norm(np.diff(known, axis=0), axis=1).sum()) if len(known) > 1 else None


def _seabed_metrics(seabed: ChartedSeabed) -> dict[str, Any]:
    grid = seabed.seabed
    known = np.isfinite(grid.mean)
    depth_m = -grid.mean[known]
    cell_m2 = float((grid.x[1] - grid.x[0]) * (grid.y[1] - grid.y[0]))
    beams = beams_per_cell(grid, seabed.beams[:, :2])[known]
    std_m = np.sqrt(total_variance(seabed))
    spread = std_m[known & np.isfinite(std_m)]
    return {
        "area_m2": int(known.sum()) * cell_m2,
        "depth_min_m": depth_m.min(),
        "depth_median_m": np.median(depth_m),
        "depth_max_m": depth_m.max(),
        "beams_per_m2": np.median(beams) / cell_m2,
        "tvu95_m": s44.SIGMAS_95 * np.median(spread) if len(spread) else None,
        "s44_order_shares": s44.shares(s44.orders_met(grid.mean, std_m)) if len(spread) else None,
    }


def _reference(run: SurveyRun, notes: list[str]) -> dict[str, Any]:
    """Horizontal and vertical CRS, as the products have them."""
    unknown = {"crs": None, "vertical_crs": None, "map_turned_by_deg": None}
    try:
        georeference = georeference_of(run.config)
    except ValueError as error:
        notes.append(f"no chart on the earth: {error}")
        return unknown
    if georeference is None:
        return unknown
    turn_rad = georeference.turn_to_grid_rad(np.zeros((1, 2)))[0]
    return {
        "crs": {"epsg": georeference.epsg, "name": georeference.name},
        "vertical_crs": {"epsg": georeference.vertical_epsg, "name": georeference.vertical_name},
        "map_turned_by_deg": np.rad2deg(turn_rad),
    }
