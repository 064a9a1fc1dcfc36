"""What a run takes of the machine: processor time and memory of its processes, over time."""

from __future__ import annotations

import threading
import time
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil


@dataclass
class Usage:
    """Series over K instants, by group of processes."""

    wall_s: np.ndarray  # [K] since the start
    cores: dict[str, np.ndarray]  # processors kept busy since the instant before
    rss_mb: dict[str, np.ndarray]  # resident memory, MB (1e6 bytes)

    def save(self, path: Path) -> None:
        """As an npz file."""
        series = {f"cores {name}": values for name, values in self.cores.items()}
        series.update({f"rss_mb {name}": values for name, values in self.rss_mb.items()})
        np.savez_compressed(path, wall_s=self.wall_s, **series)

    @classmethod
    def load(cls, path: Path) -> Usage:
        """What save() has written."""
        with np.load(path, allow_pickle=False) as file:
            groups: dict[str, dict[str, np.ndarray]] = {"cores": {}, "rss_mb": {}}
            for key in file.files:
                kind, _, name = key.partition(" ")
                if kind in groups:
                    groups[kind][name] = file[key]
            return cls(file["wall_s"], **groups)


class Monitor:
    """Looks at a process and all that it has started, every so often, until it is stopped."""

    def __init__(self, root: int, period_s: float) -> None:
        self._root = psutil.Process(root)
        self._period_s = period_s
        self._started_s = time.monotonic()
        self._rows: list[tuple[float, dict[str, float], dict[str, float]]] = []
        self._busy_s: dict[int, float] = {}  # processor time by pid
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="resources", daemon=True)
        self._thread.start()

    def stop(self) -> Usage:
        """What has been seen."""
        self._stop.set()
        self._thread.join()
        names = sorted({name for _, cores, _ in self._rows for name in cores})
        wall_s = np.array([row[0] for row in self._rows])

        def series(column: int) -> dict[str, np.ndarray]:
            return {n: np.array([row[column].get(n, 0.0) for row in self._rows]) for n in names}

        return Usage(wall_s, series(1), series(2))

    def _run(self) -> None:
        last_s = self._started_s
        self._look(self._period_s)  # what they have used before is nobody's
        while not self._stop.wait(self._period_s):
            now_s = time.monotonic()
            cores, rss_mb = self._look(now_s - last_s)
            self._rows.append((now_s - self._started_s, cores, rss_mb))
            last_s = now_s

    def _look(self, elapsed_s: float) -> tuple[dict[str, float], dict[str, float]]:
        cores: dict[str, float] = defaultdict(float)
        rss_mb: dict[str, float] = defaultdict(float)
        for process in self._processes():
            try:
                with process.oneshot():
                    name = group_of(process.cmdline())
                    times = process.cpu_times()
                    memory = process.memory_info().rss
            except psutil.Error:  # it has just ended
                continue
            busy_s = times.user + times.system
            # Of one that has started since, all that it has used.
            cores[name] += max(0.0, busy_s - self._busy_s.get(process.pid, 0.0)) / elapsed_s
            rss_mb[name] += memory / 1e6
            self._busy_s[process.pid] = busy_s
        return dict(cores), dict(rss_mb)

    def _processes(self) -> list[psutil.Process]:
        try:
            return self._root.children(recursive=True)
        except psutil.Error:
            return []


def group_of(command: list[str]) -> str:
    """Core, map nodes, recorder, player, or the rest: by a process's command line."""
    line = " ".join(command)
    for part, name in _GROUPS.items():
        if part in line:
            return name
    return "ROS"


# In this order: the program that starts the map nodes counts as one of them.
_GROUPS = {
    "__name:=rbpf_core": "rbpf_core",
    "svgp_node": "map nodes",
    "survey_recorder": "recorder",
    "rosbag": "player",
}
