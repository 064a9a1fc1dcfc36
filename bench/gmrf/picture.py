"""The same beams as one particle's map has them, by each engine, beside the true seabed."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Callable

import numpy as np
from matplotlib import pyplot as plt

from bench.figures import save
from bench.gmrf.accuracy import mapped
from bench.gmrf.surveys import PlacedSurvey, placed_survey
from bench.svgp.in_process import group, take_in, train
from rbpf_svgp_slam.figures.figure_style import (
    DEPTH_LABEL,
    DEPTH_MAP,
    WIDTH_IN,
    colour_bar,
    draw_grid,
    map_axes,
)
from rbpf_svgp_slam.gmrf.gmrf_config import GmrfConfig
from rbpf_svgp_slam.metrics.map_metrics import grid_prediction

MISSION, SEED = "demo", 31
RESOLUTION_M = 0.5
#: Steps of the SVGP's teacher, by which it has long converged.
TEACHER_STEPS, MINIBATCH = 1500, 1000


def run(out: Path) -> dict[str, Any]:
    """gmrf_maps.png, and the RMSE of each map against the true seabed where beams fell."""
    survey = placed_survey(MISSION, SEED)
    beams = survey.beams
    low, high = (np.percentile(beams[:, :2], q, axis=0) for q in (2.0, 98.0))
    x, y = (np.arange(a, b, RESOLUTION_M) for a, b in zip(low, high))
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    maps = {
        "svgp, S = 400": _svgp(survey),
        "gmrf": mapped(survey, GmrfConfig()).predict,
        "1 m grid of cell means": lambda xy: (grid_prediction(beams, xy), None),
    }
    layers = {name: predict(points)[0].reshape(len(x), len(y)) for name, predict in maps.items()}
    true = survey.seabed_m(points).reshape(len(x), len(y))
    known = np.isfinite(layers["1 m grid of cell means"])
    save(_draw(x, y, {**layers, "true seabed": true}), out / "gmrf_maps.png")
    rmse = {name: float(np.sqrt(np.mean((z - true)[known] ** 2))) for name, z in layers.items()}
    return {"picture_rmse_m": rmse}


def _svgp(survey: PlacedSurvey) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """A streaming map of the default size, from a teacher that has seen all beams."""
    beams = survey.beams.astype(np.float32)
    low, high = beams[:, :2].min(0), beams[:, :2].max(0)
    corners = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
    node = group(corners)
    rng = np.random.default_rng(0)
    train([node.teacher], beams, MINIBATCH, TEACHER_STEPS, rng)
    one = node.create()
    sample = beams[rng.choice(len(beams), min(len(beams), 40_000), replace=False)]
    one.rebuild(sample, len(beams))
    take_in(one, beams)

    def predict(xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        parts = [one.predict(part.astype(np.float32)) for part in np.array_split(xy, 50)]
        return tuple(np.concatenate(column) for column in zip(*parts))

    return predict


def _draw(x: np.ndarray, y: np.ndarray, layers: dict[str, np.ndarray]) -> plt.Figure:
    figure, panels = plt.subplots(
        2, 2, figsize=(WIDTH_IN, 0.62 * WIDTH_IN), sharex=True, sharey=True
    )
    low, high = np.nanpercentile(layers["true seabed"], [1, 99])
    for axes, (name, z) in zip(panels.flat, layers.items()):
        map_axes(axes, name)
        image = draw_grid(axes, x, y, z, relief=True, cmap=DEPTH_MAP, vmin=low, vmax=high)
    colour_bar(image, DEPTH_LABEL)
    return figure
