"""Maps in the benchmarks' own process, made and fed as a map node does, for studies of errors."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, Iterable

import numpy as np
from numpy.typing import ArrayLike

from rbpf_svgp_slam.maps import MinibatchMap, StreamMap, make_group
from rbpf_svgp_slam.svgp.config import SvgpConfig
from rbpf_svgp_slam.svgp.group import SvgpGroup

#: Beams in one reply of the log, for maps that take them in in their order.
BLOCK_BEAMS = 1000


def group(survey_area: ArrayLike, **settings: Any) -> SvgpGroup:
    """A node's maps.

    survey_area [V, 2] in the map frame, m; settings: what differs from the default.
    """
    parameters = SimpleNamespace(
        map=SimpleNamespace(engine="svgp"),
        survey_area=survey_area,
        engine_group=SvgpConfig(**settings).as_dict(),
    )
    return make_group(parameters)


def square(centre_m: float, side_m: float) -> np.ndarray:
    """Corners [4, 2] of a survey area, m."""
    return centre_m + 0.5 * side_m * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)


def train(
    maps: Iterable[MinibatchMap], beams: np.ndarray, M: int, steps: int, rng: np.random.Generator
) -> None:
    """Steps on minibatches of M of the log's beams [N, 3], the same for all maps."""
    maps = list(maps)
    for _ in range(steps):
        minibatch = beams[rng.integers(0, len(beams), M)]
        for engine in maps:
            engine.train_step(minibatch, len(beams))


def take_in(engine: StreamMap, beams: np.ndarray) -> None:
    """All beams [n, 3] that the log now has, in their order."""
    while engine.next_beam < len(beams):
        engine.take_in(beams[engine.next_beam : engine.next_beam + BLOCK_BEAMS])


def markdown(rows: list[dict[str, Any]]) -> str:
    """A table with a line for each row; the first row's names are its head."""
    head = list(rows[0])
    lines = [head, ["---"] * len(head), *([_cell(row[name]) for name in head] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _cell(value: Any) -> str:
    if value is None:
        return "none"
    return f"{value:.3g}" if isinstance(value, float) else str(value)
