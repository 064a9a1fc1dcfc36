"""One set of settings at every scale: depth, size of the area, and distance from the map's origin.

All cases are one survey, stretched: the same beams on the same relief with the same noise but for
a factor. A method without a scale of its own gives the same numbers for all of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from bench.svgp import in_process
from rbpf_svgp_slam.maps import StreamMap
from rbpf_svgp_slam.simulation.terrain import generate_terrain
from rbpf_svgp_slam.survey_area.polygon import survey_origin
from rbpf_svgp_slam.svgp.inducing import grid_pitch_m
from rbpf_svgp_slam.svgp.svgp_map import SvgpMap

S, M, STEPS, BEAMS, HELD_OUT = 400, 1000, 300, 100_000, 4000
#: Relief and noise as multiples of those of shallow water, and the training steps that each gets.
RELIEFS, FEW_STEPS = (0.1, 1.0, 4.0, 6.0, 8.0, 12.0, 20.0), 100
#: Extent of the relief before it is stretched, m, and its resolution; features of 15 to 80 m.
RELIEF_EXTENT_M, RELIEF_RESOLUTION_M = 200.0, 0.5
#: Lines of the survey.
LINES = 10
SEED = 1


@dataclass(frozen=True)
class Case:
    """Where, and how large, a survey is."""

    depth_m: float
    side_m: float  #: of the square survey area
    centre_m: float = 0.0  #: of the survey area, easting and northing
    relief_m: float = 3.0  #: from the deepest to the shallowest point
    noise_std_m: float = 0.1  #: of a beam
    settings: dict[str, Any] = field(default_factory=dict)  #: that differ from the defaults

    @property
    def name(self) -> str:
        """Short, and unique among `CASES`."""
        parts = [f"{self.depth_m:g} m deep", f"{self.side_m:g} m wide"]
        parts += [f"at {self.centre_m / 1000:g} km"] if self.centre_m else []
        return ", ".join(parts + [f"{name} {value:g}" for name, value in self.settings.items()])


#: Relief and noise of deep water: 20 times those of shallow water.
DEEP = {"relief_m": 60.0, "noise_std_m": 2.0}
CASES = (
    Case(10.0, 100.0),
    Case(10.0, 1000.0),
    Case(10.0, 5000.0),
    Case(10.0, 100.0, 500e3),
    Case(300.0, 1000.0),
    Case(300.0, 1000.0, 500e3),
    Case(3000.0, 1000.0, **DEEP),
    Case(3000.0, 5000.0, **DEEP),
    Case(3000.0, 5000.0, 500e3, **DEEP),
    # as 10 m deep, with the initial values in proportion too: are those in metres felt?
    Case(3000.0, 1000.0, **DEEP, settings={"outputscale_m2": 20.0**2, "noise_std_m": 20.0 * 0.3}),
)


@dataclass(frozen=True)
class Survey:
    """What reaches the maps: positions relative to the survey origin, as the core sends them."""

    beams: np.ndarray  #: [N, 3] float32, in the log's order
    xy: np.ndarray  #: [n, 2] float32, where errors are measured
    z: np.ndarray  #: [n] the seabed there, m, without noise


def run(out: Path) -> dict[str, Any]:
    """Errors and learned hyperparameters by case and optimizer, and by height of the relief."""
    cases = {case.name: study(case) for case in CASES}
    rows = [
        {"case": name, "optimizer": optimizer} | figures
        for name, optimizers in cases.items()
        for optimizer, figures in optimizers.items()
    ]
    print(in_process.markdown(rows), flush=True)
    reliefs = {f"{factor:g} times": study_of_relief(factor) for factor in RELIEFS}
    rows = [{"relief and noise": name} | figures for name, figures in reliefs.items()]
    print(in_process.markdown(rows), flush=True)
    return {"scales": {"cases": cases, "natgrad_by_relief": reliefs}}


def study(case: Case, S: int = S, M: int = M, steps: int = STEPS) -> dict[str, dict[str, Any]]:
    """Of each optimizer. natgrad is the map that learns the model for streaming maps."""
    area = in_process.square(case.centre_m, case.side_m)
    settings = {"inducing_points": S, "minibatch_size": M} | case.settings
    survey = simulate(case)
    adam = in_process.group(area, optimizer="adam", **settings).create()
    node = in_process.group(area, optimizer="streaming", **settings)
    rng = np.random.default_rng(SEED)
    in_process.train((adam, node.teacher), survey.beams, M, steps, rng)
    streaming = node.create()
    _stream(streaming, survey.beams, node.rebuild_beams, rng)
    engines = {"adam": adam, "natgrad": node.teacher, "streaming": streaming}
    pitch_m = grid_pitch_m(area, S)
    return {name: _figures(engine, case, survey, pitch_m) for name, engine in engines.items()}


def study_of_relief(factor: float) -> dict[str, Any]:
    """natgrad after fewer steps, where relief and noise are so many times those of shallow water.

    The initial o and σ stay as they are: only their proportion to the relief changes.
    """
    case = Case(3000.0, 1000.0, relief_m=3.0 * factor, noise_std_m=0.1 * factor)
    area, survey = in_process.square(0.0, case.side_m), simulate(case)
    settings = {"inducing_points": S, "minibatch_size": M}
    engine = in_process.group(area, optimizer="natgrad", **settings).create()
    in_process.train((engine,), survey.beams, M, FEW_STEPS, np.random.default_rng(SEED))
    relief_std_m = float(np.std(survey.z))
    figures = _figures(engine, case, survey, grid_pitch_m(area, S))
    return {"relief's std (m)": relief_std_m} | figures


def simulate(case: Case) -> Survey:
    """Beams along lines, and points to measure errors at, uniform in the area."""
    rng = np.random.default_rng(SEED)
    extent_m = (RELIEF_EXTENT_M, RELIEF_EXTENT_M)
    relief = generate_terrain((0, 0), extent_m, RELIEF_RESOLUTION_M, 0.0, rng)
    at = rng.uniform(0.0, 1.0, (BEAMS + HELD_OUT, 2))
    z = relief.height_m(*(RELIEF_EXTENT_M * at).T)
    z = case.relief_m / np.ptp(relief.z_m) * z - case.depth_m
    origin = survey_origin(in_process.square(case.centre_m, case.side_m))
    # in the map frame, in double precision, and from there to the wire
    xy_map = case.centre_m + case.side_m * (at - 0.5)
    xy = (xy_map - origin).astype(np.float32)
    noise_m = case.noise_std_m * rng.standard_normal(BEAMS)
    order = np.lexsort((at[:BEAMS, 0], np.floor(LINES * at[:BEAMS, 1])))
    beams = np.column_stack([xy[:BEAMS], z[:BEAMS] + noise_m]).astype(np.float32)
    return Survey(beams[order], xy[BEAMS:], z[BEAMS:])


def _stream(
    engine: StreamMap, beams: np.ndarray, rebuild_beams: int, rng: np.random.Generator
) -> None:
    """A map that is rebuilt at half of the survey, from a sample, and takes in the other half."""
    half = len(beams) // 2
    sample = beams[rng.integers(0, half, rebuild_beams)]
    engine.rebuild(sample, half)
    in_process.take_in(engine, beams)


def _figures(engine: SvgpMap, case: Case, survey: Survey, pitch_m: float) -> dict[str, float]:
    """Without a unit, all of them."""
    lengthscale_m = engine.optimizer.model.hyperparameters()[0]
    rmse_m = math.sqrt(np.mean((engine.predict(survey.xy)[0] - survey.z) ** 2))
    return {
        "RMSE/relief": rmse_m / float(np.std(survey.z)),
        "RMSE/noise": rmse_m / case.noise_std_m,
        "l (pitches)": lengthscale_m / pitch_m,
        "o/relief^2": engine.prior_variance_m2 / float(np.var(survey.z)),
        "sigma/noise": math.sqrt(engine.noise_variance_m2) / case.noise_std_m,
        "skipped": engine.skipped_steps,
        "jitter raises": engine.jitter_raises,
    }
