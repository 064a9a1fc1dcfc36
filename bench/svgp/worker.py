"""A process that owns one map and trains it on request, timing its training steps and no more.

Started by `contestants`, with the python and the libraries of the map it is to run.
"""

from __future__ import annotations

import os
import sys
from typing import Any

import numpy as np
import torch

from bench.svgp import channel
from bench.svgp.trainers import MinibatchTrainer, StreamTrainer


def main() -> None:
    """Answer requests on stdin until it is closed."""
    # keep stdout for messages to the driver: what else is printed goes to stderr
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    torch.set_num_threads(1)
    worker = None
    while (request := channel.receive(sys.stdin.buffer)) is not None:
        command = request.pop("command").item()
        if command == "create":
            worker = Worker(request)
        reply = getattr(worker, command)(**request) if command != "create" else worker.versions()
        channel.send(answers, reply)


class Worker:
    """A map and the log that its minibatches are drawn from."""

    def __init__(self, request: dict[str, np.ndarray]) -> None:
        """request: see `contestants.race_request`."""
        self._beams_in_log = len(request["beams"])
        self._arrival_s = request["arrival_s"]  # [N]
        self._M = request["minibatch_size"].item()
        self._trainer = _make_trainer(request)

    def versions(self) -> dict[str, str]:
        """Of the libraries that do the work."""
        gpytorch = sys.modules.get("gpytorch")
        return {"torch": torch.__version__, "gpytorch": gpytorch.__version__ if gpytorch else ""}

    def train(self, steps: np.ndarray) -> dict[str, np.ndarray]:
        """Wall time of each of so many steps on the whole log, s."""
        advance, N = self._trainer.advance, self._beams_in_log
        return {"step_s": np.array([advance(N) for _ in range(steps)])}

    def train_until(
        self, clock_s: np.ndarray, end_s: np.ndarray, training_share: np.ndarray
    ) -> dict[str, np.ndarray]:
        """Train while the survey goes on, from clock_s to end_s: steps and the clock after them.

        Each second of survey has room for training_share seconds of training.
        """
        clock_s, steps = clock_s.item(), 0
        while clock_s < end_s:
            arrived = int(np.searchsorted(self._arrival_s, clock_s, side="right"))
            clock_s += self._trainer.advance(max(arrived, self._M)) / training_share.item()
            steps += 1
        return {"clock_s": np.array(clock_s), "steps": np.array(steps)}

    def look(self, xy: np.ndarray) -> dict[str, Any]:
        """Latent mean [n], m, and variance [n], m², at [n, 2]; m [S], T [S, S] and σ², m²."""
        engine = self._trainer.map
        mean, variance = engine.predict(xy)
        m, T = _variational_parameters(engine)
        noise = engine.noise_variance_m2
        return {"mean": mean, "variance": variance, "m": m, "T": T, "noise_variance_m2": noise}


def _make_trainer(request: dict[str, np.ndarray]) -> MinibatchTrainer:
    engine, M = request["engine"].item(), request["minibatch_size"].item()
    # every contestant draws the same minibatches
    log = request["beams"], M, np.random.default_rng(request["seed"].item())
    names = ("lengthscale_m", "outputscale_m2", "noise_std_m")
    initial = {name: request[name].item() for name in names}
    if engine == "gpytorch":
        from bench.svgp.gpytorch_map import GpytorchMap

        rate = request["learning_rate"].item()
        return MinibatchTrainer(GpytorchMap(request["Z"], learning_rate=rate, **initial), *log)
    from rbpf_svgp_slam.svgp.config import SvgpConfig
    from rbpf_svgp_slam.svgp.group import SvgpGroup

    S = len(request["Z"])
    config = SvgpConfig(optimizer=engine, inducing_points=S, minibatch_size=M, **initial)
    group = SvgpGroup(config, request["survey_area"])
    if engine == "streaming":
        return StreamTrainer(group, *log)
    return MinibatchTrainer(group.create(), *log)


def _variational_parameters(engine: Any) -> tuple[np.ndarray, np.ndarray]:
    """m [S] of the whitened q(v) = N(m, Σ), and T [S, S], triangular: Σ = T Tᵀ or TᵀT."""
    if hasattr(engine, "variational_parameters"):
        return engine.variational_parameters()
    q = engine.optimizer.gaussian()
    return q.m.numpy().astype(float), q.factor.numpy().astype(float)


if __name__ == "__main__":
    main()
