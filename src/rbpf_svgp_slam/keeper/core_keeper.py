"""Runs the core, and runs it again where a signal has ended it.

roslaunch's own respawn cannot tell a core that was killed from one that will never start, as with a
wrong parameter: that would be started again for ever.
"""

from __future__ import annotations

import signal
import subprocess
from typing import Sequence

from roslib.packages import find_node

from rbpf_svgp_slam.processes import Deaths, end_with_parent

PACKAGE, PROGRAM = "rbpf_svgp_slam", "rbpf_core"
#: The core's private parameter: go on where the journal ends.
RESUME = "_resume:=true"
# To end by itself once it has been told to; roslaunch gives us 15 s.
PATIENCE_S = 10.0
INTERRUPTS = (signal.SIGINT, signal.SIGTERM)


def keep_core(arguments: Sequence[str]) -> int | str:
    """Run the core until it ends by itself or we are told to; returns what sys.exit() takes."""
    found = find_node(PACKAGE, PROGRAM)
    if not found:
        return f"keep_core: {PACKAGE} has no program {PROGRAM}; is it built?"
    return keep([found[0], *arguments])


def keep(command: Sequence[str]) -> int | str:
    """As above. Once a signal has ended it, the command gets one more argument, RESUME."""
    for number in INTERRUPTS:
        signal.signal(number, signal.default_int_handler)
    deaths = Deaths(PROGRAM)
    child = None
    try:
        while True:
            # an interrupt in between would leave a child that nobody knows
            signal.pthread_sigmask(signal.SIG_BLOCK, INTERRUPTS)
            child = _start([*command, RESUME] if deaths else command)
            signal.pthread_sigmask(signal.SIG_UNBLOCK, INTERRUPTS)
            status = child.wait()
            if status >= 0:
                return status
            told = deaths.add(status)
            if deaths.too_many:
                return told
            print(f"{told}, and resumes from its journal", flush=True)
    except KeyboardInterrupt:
        return _stop(child)


def _start(command: Sequence[str]) -> subprocess.Popen:
    # In a session of its own: roslaunch interrupts our whole process group, and we pass it on.
    return subprocess.Popen(command, start_new_session=True, preexec_fn=_prepare)


def _prepare() -> None:
    """In the child, before its program."""
    end_with_parent()
    signal.pthread_sigmask(signal.SIG_UNBLOCK, INTERRUPTS)


def _stop(child: subprocess.Popen | None) -> int:
    for number in INTERRUPTS:
        signal.signal(number, signal.SIG_IGN)
    if child is None or child.poll() is not None:
        return 0
    child.send_signal(signal.SIGINT)
    try:
        return max(0, child.wait(PATIENCE_S))
    except subprocess.TimeoutExpired:
        child.kill()
        child.wait()
        return 1
