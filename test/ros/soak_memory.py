"""Resident memory of a launch's programs, each between two of its starts."""

from __future__ import annotations

import threading
from collections import defaultdict
from pathlib import Path
from typing import Callable, Iterator

import numpy as np
import psutil

PERIOD_S = 1.0
#: These run others, under whose names they go.
KEEPERS = ("keep_core.py", "run_launch.py", "svgp_nodes.py")


def programs(launch: int) -> dict[str, psutil.Process]:
    """Of the package, by the names of their nodes."""
    found = {}
    for process in psutil.Process(launch).children(recursive=True):
        try:
            command = process.cmdline()
        except psutil.Error:  # it has just ended
            continue
        named = [word[len("__name:=") :] for word in command if word.startswith("__name:=")]
        if named and not {Path(word).name for word in command[:2]} & set(KEEPERS):
            found[named[0]] = process
    return found


class Memory:
    """Looks once a second, for as long as the survey's clock goes on."""

    def __init__(self, launch: int, survey_s: Callable[[], float]) -> None:
        self._launch = launch
        self._survey_s = survey_s
        # Survey time and MB, by name and process.
        self._lives: dict[str, dict[int, list[tuple[float, float]]]] = defaultdict(dict)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="memory", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Look no more."""
        self._stop.set()
        self._thread.join()

    def rows(self) -> Iterator[str]:
        """A table: of each program its longest life, and how its memory grew in the later half."""
        yield "| program | lives | longest, min of survey | MB: after 1 min, at its end | MB/h |"
        yield "|---|---|---|---|---|"
        for name, lives in sorted(self._lives.items()):
            life = np.array(max(lives.values(), key=lambda life: life[-1][0] - life[0][0]))
            survey_s, mb = life[:, 0] - life[0, 0], life[:, 1]
            first_mb = np.interp(60.0, survey_s, mb)
            later = survey_s >= survey_s[-1] / 2
            slope = np.nan
            if np.count_nonzero(later) > 2:
                slope = 3600.0 * np.polyfit(survey_s[later], mb[later], 1)[0]
            yield (
                f"| `{name}` | {len(lives)} | {survey_s[-1] / 60:.1f} "
                f"| {first_mb:.0f}, {mb[-1]:.0f} | {slope:+.0f} |"
            )

    def _run(self) -> None:
        last_s = 0.0
        while not self._stop.wait(PERIOD_S):
            now_s = self._survey_s()
            if now_s <= last_s:
                continue
            last_s = now_s
            for name, process in programs(self._launch).items():
                try:
                    mb = process.memory_info().rss / 1e6
                except psutil.Error:  # it has just ended
                    continue
                self._lives[name].setdefault(process.pid, []).append((now_s, mb))
