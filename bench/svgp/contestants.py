"""Who is compared with whom, and the processes that they run in."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.paths import ENVIRONMENTS, ROOT
from bench.svgp import channel
from rbpf_svgp_slam.svgp.config import SvgpConfig
from rbpf_svgp_slam.svgp.inducing import grid_pitch_m, initial_inducing_points

SEED = 1
#: Adam's learning rate, the paper's and this package's default.
ADAM_RATE = 0.1


@dataclass(frozen=True)
class Contestant:
    """An implementation and the python that runs it."""

    name: str
    engine: str  #: gpytorch, or one of our optimizers
    python: str

    @property
    def ours(self) -> bool:
        return self.engine != "gpytorch"


GPYTORCH_NEWEST = Contestant(
    "gpytorch_newest", "gpytorch", str(ENVIRONMENTS / "newest" / "bin" / "python")
)
GPYTORCH_SAME_TORCH = Contestant(
    "gpytorch_same_torch", "gpytorch", str(ENVIRONMENTS / "same_torch" / "bin" / "python")
)


def ours(optimizer: str) -> Contestant:
    """This package's SVGP with one of its optimizers."""
    return Contestant(optimizer, optimizer, sys.executable)


def available(optimizers: tuple[str, ...]) -> list[Contestant]:
    """Those of our optimizers that the package has."""
    found = []
    for optimizer in optimizers:
        try:
            SvgpConfig(optimizer=optimizer)
        except ValueError as error:
            print(f"left out: {error}", flush=True)
        else:
            found.append(ours(optimizer))
    return found


def race_request(
    beams: np.ndarray, arrival_s: np.ndarray, survey_area: np.ndarray, S: int, M: int
) -> dict[str, Any]:
    """What every worker starts from.

    beams [N, 3] x, y, z in order of arrival, m; arrival_s [N]; survey_area [V, 2], m. The initial
    values are this package's defaults.
    """
    config = SvgpConfig()
    return {
        "beams": beams.astype(np.float32),
        "arrival_s": arrival_s,
        "survey_area": survey_area,
        "minibatch_size": M,
        "seed": SEED,
        "Z": initial_inducing_points(survey_area, S),
        "lengthscale_m": 0.5 * grid_pitch_m(survey_area, S),
        "outputscale_m2": config.outputscale_m2,
        "noise_std_m": config.noise_std_m,
        "learning_rate": ADAM_RATE,
    }


class WorkerProcess:
    """A contestant at work; computes only while a call waits for its answer."""

    def __init__(self, contestant: Contestant, request: dict[str, Any]) -> None:
        self.contestant = contestant
        self._process = subprocess.Popen(
            [contestant.python, "-W", "ignore", "-m", "bench.svgp.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            cwd=ROOT,
            env=_environment(contestant),
        )
        reply = self._call("create", engine=contestant.engine, **request)
        self.versions = {name: version.item() for name, version in reply.items() if version.item()}

    def __enter__(self) -> WorkerProcess:
        return self

    def __exit__(self, *_: Any) -> None:
        self._process.stdin.close()
        self._process.wait()

    def train(self, steps: int) -> np.ndarray:
        """Wall time of each of so many steps, s."""
        return self._call("train", steps=steps)["step_s"]

    def train_until(self, clock_s: float, end_s: float, training_share: float) -> tuple[float, int]:
        """Train from one time of the survey to another: the clock then, s, and the steps taken."""
        reply = self._call(
            "train_until", clock_s=clock_s, end_s=end_s, training_share=training_share
        )
        return reply["clock_s"].item(), reply["steps"].item()

    def look(self, xy: np.ndarray) -> dict[str, np.ndarray]:
        """Predictions at [n, 2] and parameters; see `Worker.look`."""
        return self._call("look", xy=xy)

    def _call(self, command: str, **request: Any) -> dict[str, np.ndarray]:
        channel.send(self._process.stdin, {"command": command, **request})
        reply = channel.receive(self._process.stdout)
        if reply is None:
            raise RuntimeError(f"{self.contestant.name}: the worker ended during {command!r}")
        return reply


def _environment(contestant: Contestant) -> dict[str, str]:
    """One thread; and for the others nothing of this package or its libraries."""
    environment = dict(os.environ)
    if not contestant.ours:
        environment.pop("PYTHONPATH", None)
    for library in ("OMP", "OPENBLAS", "MKL"):
        environment[f"{library}_NUM_THREADS"] = "1"
    return environment
