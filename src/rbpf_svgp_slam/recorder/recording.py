"""What the recorder has heard of a survey by its end."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rbpf_svgp_slam.msg import FilterStatus, MapStatus
from rbpf_svgp_slam.parameters.loading import NodeParameters
from rbpf_svgp_slam.recorder.ground_truth import GroundTruth
from rbpf_svgp_slam.recorder.history import History
from rbpf_svgp_slam.recorder.time_lapse import TimeLapseRecorder


@dataclass
class Recording:
    """Grows while the survey goes on."""

    out_dir: Path
    parameters: NodeParameters
    parameter_tree: dict[str, Any]  # the full set, as the run folder keeps it
    terrain_file: str  # the true seabed of a simulated survey; empty: not known
    time_lapse: TimeLapseRecorder
    ground_truth: GroundTruth
    statuses: list[FilterStatus] = field(default_factory=list)
    # The latest of each process that has been a map node, by node and restarts, in their order.
    map_lives: dict[tuple[int, int], MapStatus] = field(default_factory=dict)
    history: History = field(default_factory=History)
    started_s: float | None = None  # wall clock, at the first odometry
    wall_s: float = 0.0  # that the survey took, once it is over

    @property
    def map_statuses(self) -> dict[int, MapStatus]:
        """The latest, by node."""
        return {node: status for (node, _), status in self.map_lives.items()}
