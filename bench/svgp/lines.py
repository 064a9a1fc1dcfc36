"""What each line of a training step costs: arithmetic by formula, time as measured."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any, Callable

import numpy as np
import torch

from rbpf_svgp_slam.svgp import linalg
from rbpf_svgp_slam.svgp.adam import Adam
from rbpf_svgp_slam.svgp.inducing import grid_pitch_m, initial_inducing_points
from rbpf_svgp_slam.svgp.kernels import Correlation
from rbpf_svgp_slam.svgp.natural import moments
from rbpf_svgp_slam.svgp.parameters import Model
from rbpf_svgp_slam.svgp.prior import Prior

S, M = 400, 1000
AREA = [[0.0, 0.0], [200.0, 0.0], [200.0, 150.0], [0.0, 150.0]]
REPEATS = 40
ADAM, NATGRAD, STREAMING = "adam", "natgrad", "streaming"

#: What it computes, floating-point operations, which optimizers do it each step, the call.
Line = tuple[str, float, tuple[str, ...], Callable[[], object]]


def run(out: Path) -> dict[str, Any]:
    """Per line its MFLOP and its shortest time, and the sums by optimizer."""
    torch.set_num_threads(1)
    torch.set_flush_denormal(True)
    rows = [(name, flop, users, _shortest_ms(call)) for name, flop, users, call in lines()]
    for name, flop, users, ms in rows:
        print(f"{name:44s} {flop / 1e6:7.1f} MFLOP {ms:7.3f} ms  {', '.join(users)}")
    totals = {
        user: {
            "mflop": sum(row[1] for row in rows if user in row[2]) / 1e6,
            "ms": sum(row[3] for row in rows if user in row[2]),
        }
        for user in (ADAM, NATGRAD, STREAMING)
    }
    figures = {name: {"mflop": flop / 1e6, "ms": ms} for name, flop, _, ms in rows}
    return {"lines": figures, "lines_total": totals}


def lines() -> list[Line]:
    """Every line that takes more than a hundredth of a step, in the order of the computation."""
    single, double, both = torch.float32, torch.float64, (ADAM, NATGRAD)
    rng = np.random.default_rng(0)
    model = Model.zeros(S, single, "cpu")
    model.Z.copy_(torch.from_numpy(initial_inducing_points(AREA, S)))
    model.set_hyperparameters(grid_pitch_m(AREA, S), 1.0, 0.04)
    X = torch.from_numpy((rng.random((M, 2)) * [200.0, 150.0]).astype(np.float32))
    prior, zx = Prior(S, "matern12", 1e-4, single, "cpu"), Correlation(
        "matern12", (S, M), single, "cpu"
    )
    L_inverse, rho = prior.factorise(model), zx.evaluate(model.Z, X, 9.0).clone()
    K = prior.correlation.evaluate(model.Z, model.Z, 9.0).double() + 1e-4 * torch.eye(S)
    A = linalg.product_with_lower(L_inverse, rho, torch.empty(S, M))
    G, H, W = A @ A.T, torch.eye(S) - 0.01 * torch.ones(S, S), torch.randn(S, M)
    A_double, G_double, R = A.double(), (A @ A.T).double() / M, torch.eye(S)
    e, m = torch.randn(M), torch.randn(S)
    square, lower = torch.zeros(S, S), torch.zeros(S, S)
    square_double, inverse = torch.zeros(S, S, dtype=double), torch.zeros(S, S)
    wide, shift = torch.empty(S, M), torch.ones(S, dtype=double)
    adam, vector = Adam(S + S * S + 2 * S + 4, single, "cpu"), torch.randn(S + S * S + 2 * S + 4)
    L_single = torch.linalg.cholesky(K).float()

    dZ = torch.zeros(S, 2)

    def pull_back(correlation: Correlation, gradient: torch.Tensor) -> None:
        correlation._h.fill_(1.0)
        correlation.pull_back(gradient, dZ, None if correlation is zx else dZ)

    def outer_and_product() -> None:
        torch.outer(m, e, out=wide).addmm_(square, A)

    def adam_step() -> None:
        adam.step(vector, vector, [(len(vector), 0.1)])

    cube, wide_flop = float(S) ** 3, 2.0 * S * S * M
    return [
        ("ρ(Z, Z)", 8.0 * S * S, both, lambda: prior.correlation.evaluate(model.Z, model.Z, 9.0)),
        ("L: Cholesky, float64", cube / 3, both, lambda: torch.linalg.cholesky_ex(K)),
        ("L⁻¹", cube / 3, both, lambda: linalg.inverse_of_lower(L_single, inverse)),
        ("ρ(Z, X)", 8.0 * S * M, (*both, STREAMING), lambda: zx.evaluate(model.Z, X, 9.0)),
        ("A = L⁻¹ρ(Z, X)", wide_flop / 2, (*both, STREAMING),
         lambda: linalg.product_with_lower(L_inverse, rho, wide)),
        ("G = A Aᵀ", wide_flop / 2, (ADAM,), lambda: linalg.gram(A, square)),
        ("G = A Aᵀ, float64", wide_flop / 2, (NATGRAD,),
         lambda: linalg.gram(A_double, square_double)),
        ("Σ a aᵀ, float64", wide_flop / 2, (STREAMING,),
         lambda: linalg.gram(A_double, square_double)),
        ("Λ: Cholesky, float64; its inverse; m", 2 * cube / 3, (NATGRAD,),
         lambda: moments(G_double, shift, 1e5, single)),
        ("H = I − R Rᵀ", cube / 3, (ADAM,), lambda: linalg.gram_of_lower(R, square)),
        ("H = I − FᵀF", cube / 3, (NATGRAD,), lambda: linalg.gram_of_transposed_lower(R, square)),
        ("tril(G R)", cube / 3, (ADAM,), lambda: linalg.lower_of_product_with_lower(G, R, lower)),
        ("Q = tril(H G)", cube, both, lambda: linalg.lower_of_product(H, G, lower)),
        ("V = L⁻ᵀH", cube, both,
         lambda: linalg.product_with_transposed_lower(L_inverse, H, square)),
        ("W = m eᵀ + V A", wide_flop, both, outer_and_product),
        ("U = −L⁻ᵀ Q L⁻¹", 4 * cube / 3, both,
         lambda: linalg.product_with_transposed_lower(
             L_inverse, linalg.product_of_lowers(lower, L_inverse, torch.zeros(S, S)), square)),
        ("∂Z, ∂ℓ through ρ(Z, X)", 8.0 * S * M, both, lambda: pull_back(zx, W)),
        ("∂Z, ∂ℓ through ρ(Z, Z)", 8.0 * S * S, both, lambda: pull_back(prior.correlation, G)),
        ("Adam on m, R, Z, ℓ, o, σ², c", 14.0 * len(vector), (ADAM,), adam_step),
        ("site ← (1 − r)·site + r·batch", 3.0 * S * S, (NATGRAD,),
         lambda: square_double.mul_(0.9).add_(G_double, alpha=0.1)),
    ]  # fmt: skip


def _shortest_ms(call: Callable[[], object]) -> float:
    """Of many calls: what else runs on the machine only ever adds to it."""
    times_s = []
    for _ in range(REPEATS):
        start_s = time.perf_counter()
        call()
        times_s.append(time.perf_counter() - start_s)
    return 1e3 * min(times_s)
