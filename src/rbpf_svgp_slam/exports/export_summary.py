"""What an export says of itself: metadata for its files, summary.json and summary.md."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from rbpf_svgp_slam.charts import s44, uncertainty
from rbpf_svgp_slam.charts.chart import Chart
from rbpf_svgp_slam.exports.exported_run import ExportedRun
from rbpf_svgp_slam.charts.georeference import Georeference

# Beyond it, a metre of the grid is none on the ground.
_GRID_SCALE_TOLERANCE = 0.01


def metadata_of(run: ExportedRun, georeference: Georeference) -> dict[str, str]:
    """For every file, in words; ASCII but for names."""
    has_covariance = run.covariance is not None
    return {
        "title": f"Seabed and track of a survey, from {run.source} by rbpf_svgp_slam",
        "heights": (
            "z of the map frame, up from the water's surface, taken as "
            f"{georeference.vertical_name} (EPSG:{georeference.vertical_epsg}) without correction."
        ),
        "uncertainty": uncertainty.INCLUDED if has_covariance else uncertainty.WITHOUT_TRAJECTORY,
        "uncertainty_lacks": uncertainty.MISSING,
    }


def summary_of(
    run: ExportedRun, chart: Chart, contour_interval_m: float, exaggeration: float
) -> dict[str, Any]:
    """Where the chart lies, what is on it, and what must be known about it."""
    georeference = chart.georeference
    scale = grid_scale(georeference)
    rows, columns = chart.elevation.shape
    turn_rad = georeference.turn_to_grid_rad(np.zeros((1, 2)))[0]
    return {
        "seabed": run.source,
        "survey_origin": list(georeference.origin_deg),
        "crs": {"epsg": georeference.epsg, "name": georeference.name},
        "vertical_crs": {
            "epsg": georeference.vertical_epsg,
            "name": georeference.vertical_name,
        },
        "map_turned_by_deg": float(np.rad2deg(turn_rad)),
        "grid_scale": scale,
        "resolution_m": chart.resolution_m,
        "rows": rows,
        "columns": columns,
        "west_m": chart.west_m,
        "north_m": chart.north_m,
        "known_cells": int(chart.known.sum()),
        "soundings": int(chart.density.sum()),
        "soundings_per_known_cell": _median(chart.density[chart.known]),
        "depth_m": _range(-chart.elevation[chart.known]),
        "std_m": _quantiles(chart.std),
        "seabed_std_m": _quantiles(chart.seabed_std),
        "position_std_m": _quantiles(chart.position_std),
        "noise_std_m": float(np.sqrt(run.noise_variance_m2)),
        "s44_order_shares": s44.shares(chart.order),
        "contour_interval_m": contour_interval_m,
        "hillshade_exaggeration": exaggeration,
        "notes": [
            *metadata_of(run, georeference).values(),
            s44.BY_TVU_ALONE,
            *warnings_of(georeference),
        ],
    }


def write_summary(summary: dict[str, Any], folder: Path) -> None:
    """summary.json, and the same for reading as summary.md."""
    text = json.dumps(summary, indent=2, allow_nan=False)
    (folder / "summary.json").write_text(text + "\n", encoding="utf-8")
    (folder / "summary.md").write_text(_page(summary), encoding="utf-8")


def grid_scale(georeference: Georeference) -> float:
    """Length in the grid of a metre on the ground, to the east of the origin."""
    reach_m = 100.0
    west, east = georeference.projected(np.array([[-reach_m, 0.0], [reach_m, 0.0]]))
    return float(np.linalg.norm(east - west) / (2 * reach_m))


def warnings_of(georeference: Georeference) -> list[str]:
    """Sentences on what the CRS is not made for: the survey's lengths, or its place."""
    warnings, scale = [], grid_scale(georeference)
    if abs(scale - 1) > _GRID_SCALE_TOLERANCE:
        warnings.append(
            f"A metre on the ground is {scale:.3f} m of {georeference.name}: lengths and areas "
            "measured in it are wrong by that."
        )
    meant_for = georeference.outside_of_use()
    if meant_for:
        warnings.append(f"The origin is not where {georeference.name} is meant for: {meant_for}")
    return warnings


def _page(summary: dict[str, Any]) -> str:
    latitude, longitude = summary["survey_origin"]
    crs, vertical = summary["crs"], summary["vertical_crs"]
    low, high = summary["depth_m"]
    facts = {
        "seabed": summary["seabed"],
        "origin": f"latitude {latitude:.7f}°, longitude {longitude:.7f}°",
        "horizontal CRS": f"EPSG:{crs['epsg']}, {crs['name']}",
        "vertical CRS": f"EPSG:{vertical['epsg']}, {vertical['name']}",
        "map frame turned by": f"{summary['map_turned_by_deg']:.3f}°, anticlockwise",
        "grid": f"{summary['rows']} × {summary['columns']} cells of {summary['resolution_m']:g} m",
        "cells with a seabed": str(summary["known_cells"]),
        "soundings": str(summary["soundings"]),
        "depth": f"{low:.2f} to {high:.2f} m",
        "contours every": f"{summary['contour_interval_m']:g} m",
        "hillshade's heights times": f"{summary['hillshade_exaggeration']:.3g}",
    }
    spreads = {
        "of a depth": summary["std_m"],
        "of the seabed's mean": summary["seabed_std_m"],
        "by the trajectory": summary["position_std_m"],
    }
    lines = ["# Export", "", "| | |", "|---|---|"]
    lines += [f"| {name} | {text} |" for name, text in facts.items()]
    lines += ["", "| standard deviation, m | median | 95 % of the cells below |", "|---|---|---|"]
    lines += [f"| {name} | {q['median']:.3f} | {q['p95']:.3f} |" for name, q in spreads.items()]
    lines += [f"| of a beam about the seabed | {summary['noise_std_m']:.3f} | |"]
    lines += ["", "| strictest S-44 order met | share of the cells |", "|---|---|"]
    shares = summary["s44_order_shares"].items()
    lines += [f"| {name} | {100 * share:.1f} % |" for name, share in shares]
    lines += ["", *(f"- {note}" for note in summary["notes"])]
    return "\n".join(lines) + "\n"


def _range(values: np.ndarray) -> list[float]:
    return [float(values.min()), float(values.max())]


def _median(values: np.ndarray) -> float:
    return float(np.median(values))


def _quantiles(layer: np.ndarray) -> dict[str, float]:
    known = layer[np.isfinite(layer)]
    return {"median": _median(known), "p95": float(np.percentile(known, 95))}
