"""The filter's statuses over time, as far as figures want them."""

from __future__ import annotations

import math

import numpy as np

from rbpf_svgp_slam.msg import FilterStatus, MapStatus

# Name of a series, and its field in the status.
SERIES = {
    "n_eff": "n_eff",
    "iterations_total": "iterations",
    "ready_maps": "maps_ready",
    "loop_closure_prompts": "prompts",
    "resamplings": "epoch",
    "tau": "tempering",
    "overlap": "overlap",
    "beams": "beams",
    "pings_dropped": "pings_dropped",
}
# Whose training is followed: particle 0's, with whatever map it has inherited.
PARTICLE = 0


class History:
    """Series over the survey's own time, which map nodes do not know in an offline replay."""

    def __init__(self) -> None:
        self._rows: list[tuple[float, ...]] = []
        self._elbo = math.nan  # nats per beam

    def on_map_status(self, status: MapStatus) -> None:
        """Of any node."""
        if PARTICLE in status.particles:
            self._elbo = status.objective[status.particles.index(PARTICLE)]

    def on_status(self, status: FilterStatus) -> None:
        """A row for each status from the survey's start on."""
        if status.odometry_messages:
            fields = [float(getattr(status, field)) for field in SERIES.values()]
            self._rows.append((status.header.stamp.to_sec(), *fields, self._elbo))

    def series(self) -> dict[str, np.ndarray]:
        """By name, all of one length; t_s holds the stamps."""
        names = ("t_s", *SERIES, "elbo")
        columns = np.array(self._rows, dtype=float).reshape(-1, len(names)).T
        return dict(zip(names, columns))
