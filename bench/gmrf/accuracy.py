"""How well a map resolves the seabed, beside a 1 m grid of cell means and the spacing's choice."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from bench.gmrf.surveys import placed_survey
from rbpf_svgp_slam.gmrf.gmrf_group import GmrfGroup
from rbpf_svgp_slam.gmrf.gmrf_config import GmrfConfig
from rbpf_svgp_slam.gmrf.gmrf_map import GmrfMap
from rbpf_svgp_slam.metrics.map_metrics import msll, rmse, score_held_out

#: A real seabed, if it is at hand: see the README of the data.
REAL_SEABED = Path(__file__).parents[3] / "shared" / "data" / "block_b_1m.npz"
#: Name to mission, seed, scale of the duration, share of outliers.
SURVEYS = {
    "demo": ("demo", 31, 1.0, 0.01),
    "demo_other_seabed": ("demo", 32, 1.0, 0.01),
    "demo_no_outliers": ("demo", 31, 1.0, 0.0),
    "demo_5_percent_outliers": ("demo", 31, 1.0, 0.05),
    "lolo3": ("lolo3", 33, 0.4, 0.01),
    "real_seabed": ("lolo3", 34, 0.4, 0.01),
}
SPACINGS_M = (1.0, 2.0, 4.0)  # beside the one that is chosen


def run(out: Path) -> dict[str, Any]:
    """By survey and spacing: RMSE over a 1 m grid's, MSLL of both, normalised squared error."""
    figures = {}
    for name, (mission, seed, scale, outliers) in SURVEYS.items():
        terrain = REAL_SEABED if name == "real_seabed" else None
        if terrain and not terrain.exists():
            print(f"{name}: {terrain} is not there: left out", flush=True)
            continue
        survey = placed_survey(mission, seed, scale, terrain, outliers)
        figures[name] = {
            "chosen" if spacing_m == 0.0 else f"h_{spacing_m:g}": _score(survey, spacing_m)
            for spacing_m in (0.0, *SPACINGS_M)
        }
        chosen = figures[name]["chosen"]
        print(f"{name}: h {chosen['spacing_m']:.2g} m, RMSE {chosen['rmse_m']:.3f} m", flush=True)
    worst = max(one["chosen"]["rmse_over_grid"] for one in figures.values())
    return {"rmse_over_grid_worst": worst, "accuracy": figures}


def mapped(survey, config: GmrfConfig) -> GmrfMap:
    """The survey's map, as a map node would make it."""
    group = GmrfGroup(config)
    one, beams, taken = group.create(), survey.beams, 0
    for block in survey.blocks():
        while (due := group.study_due(taken + len(block))) is not None:
            first, size = due
            group.study(beams[first : first + size])
        if group.studied:
            one.take_in(beams[one.next_beam : taken + len(block)])
        taken += len(block)
    return one


def _score(survey, spacing_m: float) -> dict[str, float]:
    one = mapped(survey, GmrfConfig(spacing_m=spacing_m))
    beams, held_out = survey.beams, survey.held_out
    scores = score_held_out(one.predict, one.noise_variance_m2, held_out, beams)
    on_grid = scores.on_grid
    grid_residual = scores.grid_residual_m[on_grid]
    grid_rmse_m, rmse_m = rmse(grid_residual), rmse(scores.residual_m[on_grid])
    grid_variance = np.full(len(grid_residual), grid_rmse_m**2)  # the best that it could say
    z = held_out[on_grid, 2]
    model = one.field.model
    return {
        "spacing_m": model.spacing_m,
        "lengthscale_m": model.lengthscale_m,
        "outputscale_std_m": math.sqrt(model.outputscale_m2),
        "noise_std_m": math.sqrt(model.noise_variance_m2),
        "rmse_m": rmse_m,
        "grid_rmse_m": grid_rmse_m,
        "rmse_over_grid": rmse_m / grid_rmse_m,
        "msll": scores.msll,
        "grid_msll": msll(
            z, z - grid_residual, grid_variance, beams[:, 2].mean(), beams[:, 2].var()
        ),
        "normalised_squared_error": float(np.mean(scores.standardised**2)),
    }
