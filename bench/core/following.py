"""What a node does when the past is corrected: its maps made anew, shared histories once."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np

from rbpf_svgp_slam.gmrf.gmrf_config import GmrfConfig
from rbpf_svgp_slam.gmrf.gmrf_group import GmrfGroup
from rbpf_svgp_slam.map_node.refolding import Refolding
from rbpf_svgp_slam.map_node.stream_training import BLOCK_BEAMS, REFOLD_BLOCKS
from rbpf_svgp_slam.maps.log_block import POSE, LogBlock
from rbpf_svgp_slam.maps.map_group import MapGroup
from rbpf_svgp_slam.svgp.config import SvgpConfig
from rbpf_svgp_slam.svgp.group import SvgpGroup

PING_BEAMS, RESAMPLINGS = 256, 20
#: m between pings, length of a survey line and distance to the next; half of a swath.
STEP_M, LINE_M, LINE_DISTANCE_M, HALF_SWATH_M = 0.5, 300.0, 20.0, 25.0
#: By name: engine, particles of the node, pings.
CASES = {
    "gmrf_j1": ("gmrf", 1, 1600),
    "gmrf_j20": ("gmrf", 20, 1600),
    "gmrf_j250": ("gmrf", 250, 1600),
    "gmrf_j20_long": ("gmrf", 20, 8000),
    "svgp_j20": ("svgp", 20, 1600),
}


def run(out: Path) -> dict[str, Any]:
    """By case, processor time, s, histories at a ping on average, and the longest step, s.

    Of the first refolding, and the time of a later one that knows the beams' weights.
    """
    return {"following": {name: _following(*case) for name, case in CASES.items()}}


def histories(particles: int, pings: int) -> np.ndarray:
    """Poses [J, K] over lines to and fro, of particles that are resampled now and then."""
    rng = np.random.default_rng(0)
    drift = np.cumsum(rng.normal(0.0, 0.01, (pings, particles, 2)), axis=0).transpose(1, 0, 2)
    for ping in np.linspace(0, pings, RESAMPLINGS + 2)[1:-1].astype(int):
        drift[:, :ping] = drift[_ancestors(rng, particles), :ping]
    line, along = np.divmod(STEP_M * np.arange(pings), LINE_M)
    back = line % 2 == 1
    poses = np.zeros((particles, pings), POSE)
    poses["x"] = np.where(back, LINE_M - along, along) + drift[:, :, 0]
    poses["y"] = LINE_DISTANCE_M * line + drift[:, :, 1]
    poses["cos"] = np.where(back, -1.0, 1.0)
    return poses


def _ancestors(rng: np.random.Generator, particles: int) -> list[int]:
    """Systematic resampling by exponential weights; who has offspring is their own."""
    weights = rng.exponential(size=particles)
    cumulative = np.cumsum(weights / weights.sum())
    drawn = np.searchsorted(cumulative, (rng.random() + np.arange(particles)) / particles)
    offspring = np.bincount(np.minimum(drawn, particles - 1), minlength=particles)
    spare = iter(np.repeat(np.arange(particles), np.maximum(offspring - 1, 0)).tolist())
    return [j if offspring[j] else next(spare) for j in range(particles)]


def survey(particles: int, pings: int) -> LogBlock:
    """A whole log of a wavy seabed."""
    rng = np.random.default_rng(1)
    levelled = np.zeros((pings * PING_BEAMS, 3), np.float32)
    levelled[:, 1] = np.tile(np.linspace(-HALF_SWATH_M, HALF_SWATH_M, PING_BEAMS), pings)
    log = LogBlock(levelled, np.full(pings, PING_BEAMS), histories(particles, pings))
    x, y, _ = log.placed(0).T
    noise = 0.05 * rng.standard_normal(len(levelled))
    levelled[:, 2] = -30.0 + np.sin(x / 20.0) + 0.5 * np.cos(y / 13.0) + noise
    return log


def _group(engine: str, log: LogBlock) -> MapGroup:
    """That has learned what its maps have in common."""
    beams = log.placed(0)
    if engine == "gmrf":
        group = GmrfGroup(GmrfConfig(2.0, 25.0, 0.5, 0.05))
        group.study(beams[:4000])
        return group
    low, high = beams[:, :2].min(0), beams[:, :2].max(0)
    area = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
    group = SvgpGroup(SvgpConfig(optimizer="streaming"), area)
    rng = np.random.default_rng(2)
    for _ in range(5):
        group.teacher.train_step(beams[rng.integers(0, len(beams), 1000)], len(beams))
    return group


def _following(engine: str, particles: int, pings: int) -> dict[str, float]:
    log = survey(particles, pings)
    group = _group(engine, log)
    # The second and the third refolding find the weights of all beams again, the fourth does not.
    first, _, _, fourth = (_refolding(group, log, particles) for _ in range(4))
    print(
        f"{engine}, {particles} particles, {len(log)} beams: {first['cpu_s']:.2f} s, "
        f"where weights are known {fourth['cpu_s']:.2f} s",
        flush=True,
    )
    return {"beams": len(log), **first, "weights_known_cpu_s": fourth["cpu_s"]}


def _refolding(group: MapGroup, log: LogBlock, particles: int) -> dict[str, float]:
    share = min(1.0, group.rebuild_beams / len(log)) if group.rebuild_beams else 1.0
    start_s, longest_s, size = time.process_time(), 0.0, REFOLD_BLOCKS * BLOCK_BEAMS
    new = Refolding(group, range(particles), share)
    while new.next_beam < len(log):
        block = log.part(new.next_beam, min(new.next_beam + size, len(log)))
        for step in new.steps(block, BLOCK_BEAMS):
            step_start_s = time.perf_counter()
            step()
            longest_s = max(longest_s, time.perf_counter() - step_start_s)
    new.maps()
    return {
        "cpu_s": time.process_time() - start_s,
        "histories_at_a_ping": new.folded / new.taken,
        "longest_step_s": longest_s,
    }
