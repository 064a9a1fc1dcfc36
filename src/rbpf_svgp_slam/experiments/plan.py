"""What is run in each of the paper's experiments, and what the paper reports of it.

The paper's parameters as far as they are known: the missions' (simulation/mission.py), S and M, the
optimizer, (J, B) and f_LC. All else is config/default.yaml's.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field
from typing import Any

import yaml

from rbpf_svgp_slam.experiments import ExperimentError
from rbpf_svgp_slam.nested import merged
from rbpf_svgp_slam.parameters.known import config_folder

_CORES = os.cpu_count() or 1
# Of all maps together, about what two cores manage live.
LIVE_ADAM_STEPS_PER_S = 100.0


@dataclass(frozen=True)
class Configuration:
    """One row of an experiment's table."""

    particles: int  # J
    nodes: int  # B
    adam_steps: int | None = None  # per particle, offline with svgp/optimizer adam
    paper: dict[str, float] = field(default_factory=dict)  # what the paper reports, by report field
    engine: str = "svgp"  # map/engine

    @property
    def name(self) -> str:
        """Of its run folder."""
        suffix = "" if self.engine == "svgp" else f"_{self.engine}"
        return f"J{self.particles}_B{self.nodes}{suffix}"


@dataclass(frozen=True)
class Experiment:
    """A mission, what is common to its runs, and the runs."""

    name: str
    title: str
    mission: str
    configurations: tuple[Configuration, ...]
    live: bool  # through rosbag play and the live nodes; else read directly
    parameters: dict[str, Any]  # an overlay on config/default.yaml
    other_load: float = 0.0  # share of the time in which another program keeps one core busy
    teacher_steps_per_s: float = 1.0  # of each node's teacher, offline, per second of survey
    figures_of: str = ""  # the configuration whose figures are shown


@dataclass(frozen=True)
class Options:
    """What the user asks for."""

    scale: float = 1.0  # of the survey's duration
    seed: int = 1
    engines: tuple[str, ...] = ("svgp",)  # configurations of others are left out
    optimizer: str = "streaming"
    rate: float = 1.0  # of a live experiment, times real time
    overlay: dict[str, Any] = field(default_factory=dict)  # the user's own, on top of everything
    only: tuple[str, ...] = ()  # names of configurations; all if empty

    def __post_init__(self) -> None:
        if not 0.0 < self.rate < math.inf:
            raise ExperimentError(f"rate is {self.rate}, expected a number above 0")


def experiment(name: str) -> Experiment:
    """The experiment of that name."""
    if name not in _EXPERIMENTS:
        raise ExperimentError(f"experiment is '{name}', expected one of {', '.join(_EXPERIMENTS)}")
    return _EXPERIMENTS[name]


def run_parameters(
    plan: Experiment,
    row: Configuration,
    options: Options,
    survey: dict[str, Any],
    duration_s: float,
) -> dict[str, Any]:
    """The overlay on config/default.yaml for one run.

    survey: what is known of the survey before it (its area, how dead reckoning drifts).
    """
    run = {
        "particles": row.particles,
        "nodes": row.nodes,
        "seed": options.seed,
        "map": {"engine": row.engine},
        "svgp": {"optimizer": options.optimizer},
        "offline": {"steps_per_second": _steps_per_second(plan, row, options, duration_s)},
    }
    parameters: dict[str, Any] = {}
    for overlay in (survey, _engine_overlay(row.engine), plan.parameters, run, options.overlay):
        parameters = merged(parameters, overlay)
    return parameters


def _engine_overlay(engine: str) -> dict[str, Any]:
    """What config/ has for the particles' maps by this engine."""
    path = config_folder() / f"{engine}.yaml"
    return yaml.safe_load(path.read_text(encoding="utf-8")) if path.exists() else {}


def _steps_per_second(
    plan: Experiment, row: Configuration, options: Options, duration_s: float
) -> float:
    """Offline: Adam gets the paper's steps; streaming maps' teachers theirs, one for each node."""
    if row.engine != "svgp" or options.optimizer == "streaming":
        return plan.teacher_steps_per_s * row.nodes
    if row.adam_steps is None:
        return LIVE_ADAM_STEPS_PER_S
    return row.adam_steps * options.scale * row.particles / duration_s


def _paper(steps: int, consistency_rmse_m: float | None = None) -> dict[str, float]:
    known = {"iterations_per_particle": steps, "map_consistency_rmse_m": consistency_rmse_m}
    return {name: value for name, value in known.items() if value is not None}


def _gmrf_rows(*particles: int) -> tuple[Configuration, ...]:
    """Rows with maps of the engine gmrf, on a map node for each core."""
    return tuple(Configuration(J, min(_CORES, J), engine="gmrf") for J in particles)


def _mapping_rows(cores: int) -> tuple[Configuration, ...]:
    """The paper's four, and B = the number of this machine's cores."""
    rows = [
        Configuration(10, min(cores, 10), 39_373),
        Configuration(100, min(cores, 100), 3_714),
        Configuration(1, 1, 202_327, _paper(202_327, 1.636)),
        Configuration(10, 1, 21_425, _paper(21_425, 1.709)),
        Configuration(10, 10, 39_373, _paper(39_373, 1.712)),
        Configuration(100, 10, 3_714, _paper(3_714, 1.995)),
    ]
    # Where the number of cores is one of the paper's B, the paper's row stands for both.
    by_name = {row.name: row for row in rows}
    return tuple(sorted(by_name.values(), key=lambda row: (row.particles, row.nodes)))


_EXPERIMENTS = {
    plan.name: plan
    for plan in (
        Experiment(
            name="exp1",
            title="Experiment 1: mapping",
            mission="hugin1",
            configurations=(*_mapping_rows(_CORES), *_gmrf_rows(1, 100, 1000)),
            live=False,
            parameters={
                # Every particle goes where dead reckoning goes, and no weight ever changes.
                "motion": {"surge_std_m": 0.0, "sway_std_m": 0.0, "yaw_std_rad": 0.0},
                "lc": {"rate_hz": 0.0},
                "smoothing": {"period_s": 0.0},
                "mapping": {"hold_back_s": 0.0},
                "svgp": {"inducing_points": 400, "minibatch_size": 1000},
            },
            teacher_steps_per_s=0.5,
            figures_of="J100_B10",
        ),
        Experiment(
            name="exp2",
            title="Experiment 2: live",
            mission="lolo2",
            configurations=(Configuration(80, 8, paper=_paper(2_965)), *_gmrf_rows(80, 1000)),
            live=True,
            parameters={
                "svgp": {"inducing_points": 400, "minibatch_size": 1000},
                "lc": {"rate_hz": 0.1},
            },
            other_load=0.5,
            figures_of="J80_B8",
        ),
        Experiment(
            name="exp3",
            title="Experiment 3: SLAM",
            mission="lolo3",
            configurations=(Configuration(100, 10), *_gmrf_rows(100, 1000)),
            live=False,
            parameters={
                "svgp": {"inducing_points": 300, "minibatch_size": 1000},
                "lc": {"rate_hz": 0.1},
            },
            teacher_steps_per_s=3.0,
            figures_of="J100_B10",
        ),
    )
}
