"""The SVGP that takes in every beam once."""

from __future__ import annotations

from typing import Callable

import numpy as np

from rbpf_svgp_slam.maps.stream_map import StreamMap
from rbpf_svgp_slam.svgp.optimizers import Streaming
from rbpf_svgp_slam.svgp.svgp_map import SvgpMap


class StreamingSvgp(SvgpMap, StreamMap):
    """A map whose q(v) is the best there is, for all beams so far, under a model it is given.

    In common: the `TaughtModel` of the node's teacher. A map that stands alone has none, and keeps
    its model.
    """

    OPTIMIZERS = {"streaming": Streaming}
    OTHERS = (
        "such a map learns from minibatches, and does not take in the log's beams in their order"
    )

    def _make_optimizer(self) -> Streaming:
        return Streaming(self.config)

    @property
    def ready(self) -> bool:
        """The teacher's: this map is as good as its model."""
        return super().ready if self.common is None else self.common.teacher.ready

    @property
    def objective(self) -> float:
        """The teacher's."""
        return super().objective if self.common is None else self.common.teacher.objective

    @property
    def next_beam(self) -> int:
        return self.optimizer.next_beam

    def take_in(self, beams: np.ndarray) -> None:
        self._step(beams, self.optimizer.fold, self.optimizer.reference_m)

    @property
    def outdated(self) -> bool:
        return self.common is not None and self.optimizer.fixed is not self.common.latest()

    def rebuild(
        self, beams: np.ndarray, beams_in_log: int, pause: Callable[[], None] = lambda: None
    ) -> None:
        fixed = self.common.latest()
        # The model's c counts from the teacher's reference.
        self._step(
            beams,
            lambda X, y: self.optimizer.rebuild(fixed, X, y, beams_in_log, pause),
            self.common.teacher.optimizer.reference_m,
        )

    def begin_anew(self) -> None:
        """Before the first beam: go by what the teacher knows now."""
        self.optimizer.fixed = self.common.latest()
        self.optimizer.reference_m = self.common.teacher.optimizer.reference_m

    def stand_for(self, beams_in_log: int) -> None:
        self.optimizer.stand_for(beams_in_log)
        self._posterior = None

    def _restore(self, entries: dict[str, np.ndarray]) -> None:
        super()._restore(entries)
        if self.common is not None:
            self.optimizer.share_if_equal(self.common.latest())
