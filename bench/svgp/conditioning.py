"""Which steps of an SVGP need double precision, where its matrices are at their worst.

That is a lengthscale of 20 inducing pitches, so that ρ(Z, Z) has next to no rank, and 12 million
beams, so that q(v)'s precision Λ reaches from 1 to N·o/σ². Every map is compared with a twin in
double precision that has seen the same beams under the same model.
"""

from __future__ import annotations

import contextlib
import itertools
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Callable, ContextManager, Iterator
from unittest import mock

import numpy as np
import torch
from torch import Tensor

from bench.svgp import in_process
from rbpf_svgp_slam.maps import MinibatchMap
from rbpf_svgp_slam.simulation.terrain import generate_terrain
from rbpf_svgp_slam.svgp import linalg, natural
from rbpf_svgp_slam.svgp.config import SvgpConfig
from rbpf_svgp_slam.svgp.group import SvgpGroup
from rbpf_svgp_slam.svgp.inducing import grid_pitch_m
from rbpf_svgp_slam.svgp.kernels import KERNELS, Correlation
from rbpf_svgp_slam.svgp.objective import Objective
from rbpf_svgp_slam.svgp.optimizers import streaming as streaming_module
from rbpf_svgp_slam.svgp.parameters import Model, Parameters
from rbpf_svgp_slam.svgp.posterior import Gaussian, Posterior
from rbpf_svgp_slam.svgp.prior import Prior
from rbpf_svgp_slam.svgp.svgp_map import SvgpMap

S, M, STEPS, BEAMS_IN_LOG = 400, 1000, 30, 12_000_000
LENGTHSCALE_PITCHES, SIDE_M = 20.0, 100.0
SIGMAS_M = (0.02, 0.1, 1.0)
#: A streaming map starts from a sample of the log so far; then it takes in so many beams.
SAMPLE, FOLDED = 20_000, 100_000
#: Maps are compared at so many points.
POINTS = 2000
JITTER = SvgpConfig().jitter
SEED = 1


@dataclass(frozen=True)
class Case:
    """A model that is not learned, and beams on a relief with a variance of o = 1 m²."""

    kernel: str
    sigma_m: float
    beams: np.ndarray  #: [FOLDED, 3] float32, m
    xy: np.ndarray  #: [POINTS, 2] float32, m
    S: int

    def group(self, optimizer: str, dtype: str) -> SvgpGroup:
        """Maps under this model."""
        area = in_process.square(0.0, SIDE_M)
        return in_process.group(
            area,
            optimizer=optimizer,
            inducing_points=self.S,
            minibatch_size=M,
            kernel=self.kernel,
            lengthscale_m=LENGTHSCALE_PITCHES * grid_pitch_m(area, self.S),
            noise_std_m=self.sigma_m,
            learn_inducing_points=False,
            learn_hyperparameters=False,
            dtype=dtype,
        )


def make_case(kernel: str, sigma_m: float, smooth: bool = False, S: int = S) -> Case:
    """Rough: the package's own relief, far rougher than ℓ says; smooth: waves as long as ℓ."""
    rng = np.random.default_rng(SEED)
    xy = rng.uniform(-0.5 * SIDE_M, 0.5 * SIDE_M, (FOLDED + POINTS, 2))
    if smooth:
        z = np.sin(2.0 * np.pi * xy / SIDE_M).sum(1)
    else:
        relief = generate_terrain((0, 0), (2 * SIDE_M, 2 * SIDE_M), 0.5, 0.0, rng)
        z = relief.height_m(*(2.0 * xy + SIDE_M).T) / relief.z_m.std()
    z = z - 30.0 + sigma_m * rng.standard_normal(len(z))
    beams = np.column_stack([xy, z])[:FOLDED].astype(np.float32)
    return Case(kernel, sigma_m, beams, xy[FOLDED:].astype(np.float32), S)


def cases() -> dict[str, Case]:
    """All kernels and σ where the relief is rough; and where it is smooth, the smallest σ."""
    found = {}
    for smooth, kernel, sigma_m in itertools.product((False, True), KERNELS, SIGMAS_M):
        if sigma_m == SIGMAS_M[0] or not smooth:
            name = f"{kernel}, {sigma_m:g} m, {'smooth' if smooth else 'rough'}"
            found[name] = make_case(kernel, sigma_m, smooth)
    return found


def run(out: Path) -> dict[str, Any]:
    """Errors by case: of the maps as they are, and with one step in another precision."""
    objective, maps = {}, {}
    for name, case in cases().items():
        objective[name] = objective_errors(case)
        maps[name] = map_errors(case)
    print(in_process.markdown(_rows(objective, "q(v)")), flush=True)
    print(in_process.markdown(_rows(maps, "map")), flush=True)
    return {"conditioning": {"objective": objective, "maps": maps}}


def _rows(tree: dict[str, dict[str, Any]], below: str) -> list[dict[str, Any]]:
    return [
        {"case": case, below: name} | figures
        for case, group in tree.items()
        for name, figures in group.items()
    ]


# The objective that Adam climbs


def objective_errors(case: Case) -> dict[str, dict[str, Any]]:
    """Relative errors of the ELBO and its gradient in single precision, for two q(v)."""
    twin = _make(case, "natgrad", "float64")
    _train(twin, case)
    optimizer = twin.optimizer
    q = optimizer.gaussian()
    X, y = torch.from_numpy(case.beams[:M].copy()).split([2, 1], 1)
    y = (y.double() - optimizer.reference_m).float()[:, 0]
    theta = Parameters(case.S, torch.float32, torch.device("cpu"))
    theta.model.copy_(optimizer.model.flat)
    theta.R.fill_diagonal_(1.0)
    errors = {"prior": _objective_errors(case, theta, X, y)}
    theta.m.copy_(q.m)
    # Σ = FᵀF = (QU)ᵀ(QU) = R Rᵀ with R = Uᵀ
    theta.R.copy_(torch.linalg.qr(q.factor)[1].T)
    errors["trained"] = _objective_errors(case, theta, X, y)
    return errors


def _objective_errors(case: Case, theta: Parameters, X: Tensor, y: Tensor) -> dict[str, Any]:
    """Of one theta, beams X [M, 2], y [M], all in single precision."""
    values, gradients = [], []
    raises = 0
    for dtype in (torch.float32, torch.float64):
        args = (case.S, len(y), case.kernel, JITTER, dtype, torch.device("cpu"))
        objective, at = Objective(*args), Parameters(case.S, dtype, torch.device("cpu"))
        at.flat.copy_(theta.flat)
        gradient = Parameters(case.S, dtype, torch.device("cpu"))
        values.append(objective.evaluate(at, X.to(dtype), y.to(dtype), BEAMS_IN_LOG, gradient))
        gradients.append(gradient)
        raises += objective.prior.jitter_raises
    single, double = gradients
    parts = {name: (getattr(single, name), getattr(double, name)) for name in ("m", "R", "Z", "c")}
    for i, name in enumerate(("l", "o", "sigma^2")):
        parts[name] = single.raw[i], double.raw[i]
    return {
        "ELBO (nats)": values[1],
        "ELBO": abs(values[0] / values[1] - 1.0),
        **{f"d{name}": _relative(*pair) for name, pair in parts.items()},
        "jitter raises": raises,
    }


def _relative(value: Tensor, reference: Tensor) -> float:
    """Norm of the difference over the reference's; 0 where both are zero."""
    difference = (value.double() - reference).norm().item()
    return difference and difference / reference.norm().item()


# Maps, and experiments: what if a step were done in single precision


def _factorise_in_single(prior: Prior, model: Model, stamp: object = None) -> Tensor:
    K = prior.correlation.evaluate(model.Z, model.Z, model.hyperparameters()[0]).float()
    L, prior.jitter_raises = linalg.cholesky(K, prior._jitter)
    return prior.L_inverse.copy_(linalg.inverse_of_lower(L, torch.zeros_like(L)))


#: Errors of a map's predictions; none where Λ has no Cholesky factor.
FIGURES = (
    "mean, RMS (% of sigma)",
    "mean, largest (% of sigma)",
    "variance, largest (% of sigma^2)",
    "variance, median (% of itself)",
)
GRAM, MOMENTS = linalg.gram, natural.moments


def _gram_in_single(A: Tensor, out: Tensor) -> Tensor:
    return out.copy_(GRAM(A.float(), torch.empty(out.shape)))


def _moments_in_single(
    precision: Tensor, shift: Tensor, weight: float, dtype: torch.dtype
) -> natural.Moments:
    return MOMENTS(precision.float(), shift.float(), weight, dtype)


@contextlib.contextmanager
def _moments_replaced(replacement: Any) -> Iterator[Any]:
    with mock.patch.object(natural, "moments", replacement):
        with mock.patch.object(streaming_module, "moments", replacement):
            yield replacement


#: Name of each experiment: the map's precision, and what is replaced while it is trained.
EXPERIMENTS: dict[str, tuple[str, Callable[[], ContextManager[Any]]]] = {
    "as it is": ("float32", contextlib.nullcontext),
    "all in double": ("float64", contextlib.nullcontext),
    "L in single": ("float32", lambda: mock.patch.object(Prior, "factorise", _factorise_in_single)),
    "sums in single": ("float32", lambda: mock.patch.object(linalg, "gram", _gram_in_single)),
    "moments in single": ("float32", lambda: _moments_replaced(_moments_in_single)),
}


def map_errors(case: Case) -> dict[str, dict[str, Any]]:
    """By optimizer and experiment, against what is as exact as double precision allows."""
    twin = _make(case, "natgrad", "float64")
    _train(twin, case)
    references = {"natgrad": twin.predict(case.xy), "streaming": _streamed_exactly(case)}
    errors = {}
    for optimizer, reference in references.items():
        for name, (dtype, experiment) in EXPERIMENTS.items():
            with experiment():
                figures = _map_errors(_make(case, optimizer, dtype), case, *reference)
            errors[f"{optimizer}, {name}"] = figures
    return errors


def _map_errors(
    engine: SvgpMap, case: Case, mean: np.ndarray, variance: np.ndarray
) -> dict[str, Any]:
    """Of a map yet to be trained; mean, variance [POINTS]: the reference."""
    figures: dict[str, Any] = dict.fromkeys(FIGURES)
    try:
        _train(engine, case)
        values = _differences(engine.predict(case.xy), mean, variance, case.sigma_m)
        figures = dict(zip(FIGURES, values))
    except (torch.linalg.LinAlgError, linalg.NotPositiveDefinite):
        pass  # none of the figures
    smallest, largest = _eigenvalues(engine)
    return figures | {
        "smallest eigenvalue": smallest,
        "largest eigenvalue": largest,
        "skipped": engine.skipped_steps,
        "jitter raises": engine.jitter_raises,
    }


def _differences(
    predicted: tuple[np.ndarray, np.ndarray], mean: np.ndarray, variance: np.ndarray, sigma_m: float
) -> list[float]:
    """What FIGURES names."""
    shift = (predicted[0] - mean) / sigma_m
    change = predicted[1] - variance
    return [
        100.0 * float(np.sqrt(np.mean(shift**2))),
        100.0 * float(np.abs(shift).max()),
        100.0 * float(np.abs(change).max()) / sigma_m**2,
        100.0 * float(np.median(np.abs(change / variance))),
    ]


def _make(case: Case, optimizer: str, dtype: str) -> SvgpMap:
    """A map under the model as single precision rounds it."""
    node = case.group(optimizer, dtype)
    engine = node.create()
    (node.teacher or engine).optimizer.model.flat.copy_(_rounded_model(case).flat)
    return engine


def _rounded_model(case: Case) -> Model:
    return case.group("natgrad", "float32").create().optimizer.model


def _train(engine: SvgpMap, case: Case) -> None:
    """Beams as a log of BEAMS_IN_LOG serves them."""
    if isinstance(engine, MinibatchMap):
        rng = np.random.default_rng(SEED)
        for _ in range(STEPS):
            engine.train_step(case.beams[rng.integers(0, len(case.beams), M)], BEAMS_IN_LOG)
        return
    beams, _ = _stream(case)
    engine.rebuild(beams[:SAMPLE], BEAMS_IN_LOG - FOLDED)
    for start in range(SAMPLE, len(beams), in_process.BLOCK_BEAMS):
        engine.take_in(beams[start : start + in_process.BLOCK_BEAMS])


def _stream(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Beams [n, 3] that reach a streaming map, and how many of the log's each stands for [n]."""
    rng = np.random.default_rng(SEED)
    sample = case.beams[rng.integers(0, len(case.beams), SAMPLE)]
    weights = np.ones(SAMPLE + FOLDED)
    weights[:SAMPLE] = (BEAMS_IN_LOG - FOLDED) / SAMPLE
    return np.concatenate([sample, case.beams]), weights


def _streamed_exactly(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance [POINTS] of a streaming map, all in double precision, written out."""
    beams, weights = (torch.from_numpy(array).double() for array in _stream(case))
    model = Model(_rounded_model(case).flat.double())
    lengthscale, o, noise = model.hyperparameters()
    double, cpu = torch.float64, torch.device("cpu")
    L_inverse = Prior(case.S, case.kernel, JITTER, double, cpu).factorise(model)
    reference_m = float(beams[:SAMPLE, 2].mean())
    precision, shift = torch.zeros((case.S, case.S), dtype=double), torch.zeros(case.S).double()
    for part, weight in zip(beams.split(M), weights.split(M)):
        correlation = Correlation(case.kernel, (case.S, len(part)), double, cpu)
        A = L_inverse @ correlation.evaluate(model.Z, part[:, :2], lengthscale)
        precision += (o / noise) * (A * weight) @ A.T
        shift += (math.sqrt(o) / noise) * A @ (weight * (part[:, 2] - reference_m))
    q = MOMENTS(precision, shift, 1.0, double)
    gaussian = Gaussian.from_inverse_root(q.m, q.F)
    posterior = Posterior(model, gaussian, case.kernel, L_inverse)
    mean, variance = posterior.marginals(torch.from_numpy(case.xy).double())
    return mean.numpy() + reference_m, variance.numpy()


def _eigenvalues(engine: SvgpMap) -> tuple[float, float]:
    """The smallest and the largest of Λ as the map has summed it up; exactly they are 1 or more."""
    with _moments_replaced(mock.Mock(side_effect=torch.linalg.LinAlgError)) as moments:
        with contextlib.suppress(torch.linalg.LinAlgError):
            engine.optimizer.gaussian()
    precision, _, weight, _ = moments.call_args.args
    Lambda = precision.double() * weight + torch.eye(len(precision), dtype=torch.float64)
    values = torch.linalg.eigvalsh(Lambda)
    return values[0].item(), values[-1].item()
