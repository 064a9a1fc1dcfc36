"""The end of a launch: quiet when all went well, and with the reason as the last word when not."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from pathlib import Path

import psutil

from rbpf_svgp_slam.protocol import names
from rbpf_svgp_slam.recorder.ground_truth import GroundTruth
from rbpf_svgp_slam.run.aside import written_aside

#: For roslaunch to pass the end on, and then for the other processes to go; less than the 15 s
#: after which roslaunch would send us SIGTERM.
PATIENCE_S = 10.0
LAUNCHERS = ("roslaunch", "run_launch.py")
#: What roslaunch ends last, after us: the master that it may have brought, and its log.
ENDED_LAST = ("rosmaster", "rosout")


def end_launch(farewell: str, ending_already: bool) -> None:
    """Let roslaunch end everything, as Ctrl-C does, and print the farewell after the others.

    A required node that simply exits would make roslaunch speak of a process that has died.
    Without a launch, as under rosrun, only the farewell is printed. ending_already: roslaunch has
    told us to end, and all others too.
    """
    told = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: told.set())
    launcher = psutil.Process(os.getppid())
    if _is_launcher(launcher):
        others = [p for p in launcher.children() if p.pid != os.getpid() and not _ends_last(p)]
        if not ending_already:
            launcher.send_signal(signal.SIGINT)
            told.wait(PATIENCE_S)
        psutil.wait_procs(others, timeout=PATIENCE_S)
    print(farewell, flush=True)


def way_out(folder: Path, ground_truth: GroundTruth) -> str:
    """What may be done for a run folder that has not been written; empty without a journal.

    Keeps what the journal does not have, if the disk takes it.
    """
    if not (folder / names.JOURNAL).is_file():
        return ""
    with contextlib.suppress(OSError), written_aside(folder) as aside:
        ground_truth.save(aside / "ground_truth.tum")
    return f". recover_run.py {folder} makes one; slam.launch resume:={folder} goes on"


def _is_launcher(process: psutil.Process) -> bool:
    return any(word.endswith(LAUNCHERS) for word in _command(process))


def _ends_last(process: psutil.Process) -> bool:
    # the program, or a script behind its interpreter
    return any(Path(word).name in ENDED_LAST for word in _command(process)[:2])


def _command(process: psutil.Process) -> list[str]:
    try:
        return process.cmdline()
    except psutil.Error:  # it has just ended
        return []
