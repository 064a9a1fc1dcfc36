"""The command line that runs a launch file and tells by its exit status how it went."""

from __future__ import annotations

import argparse
import signal
import subprocess
import sys

import roslaunch
import roslaunch.parent
import roslaunch.rlutil

PACKAGE = "rbpf_svgp_slam"
RECORDER = "survey_recorder"

_DESCRIPTION = """Run a launch file of rbpf_svgp_slam as roslaunch does, whose own exit status is 0
however a launch ends. This one's is 0 if the run folder was written (without a recorder: if no
process failed), 1 if not, 2 if nothing could be launched."""


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    parser = argparse.ArgumentParser(prog="run_launch.py", description=_DESCRIPTION)
    parser.add_argument("file", help="offline.launch, replay.launch or slam.launch")
    parser.add_argument("arguments", nargs="*", metavar="name:=value", help="the launch file's")
    given = parser.parse_args(argv)
    uuid = roslaunch.rlutil.get_or_generate_uuid(None, False)
    roslaunch.configure_logging(uuid)
    deaths = _Deaths()
    try:
        [file] = roslaunch.rlutil.resolve_launch_arguments([PACKAGE, given.file])
        launch = roslaunch.parent.ROSLaunchParent(
            uuid,
            [(file, given.arguments)],
            process_listeners=[deaths],
            show_summary=False,
        )
        launch.start()
    except roslaunch.RLException as error:
        print(f"run_launch.py: {error}", file=sys.stderr)
        return 2
    # roslaunch forgets them when it stops them
    programs = {process.name: process.popen for process in launch.pm.procs}
    launch.spin()
    status = _status(programs, deaths)
    if status:
        # the recorder's last words cannot tell who has brought the launch down
        print("\n".join(deaths.told()), file=sys.stderr)
    return status


class _Deaths(roslaunch.pmon.ProcessListener):
    """Processes that have ended before they were told to, with their exit status."""

    def __init__(self) -> None:
        self.status_of: dict[str, int | None] = {}

    def process_died(self, process_name: str, exit_code: int | None) -> None:
        """Called by roslaunch."""
        self.status_of[process_name] = exit_code

    def told(self) -> list[str]:
        """A line for each that did not end well."""
        return [f"run_launch.py: {name} {_end(n)}" for name, n in self.status_of.items() if n]


def _end(exit_code: int) -> str:
    if exit_code > 0:
        return f"has died with exit status {exit_code}"
    return f"was killed by {signal.Signals(-exit_code).name}"


def _status(programs: dict[str, subprocess.Popen], deaths: _Deaths) -> int:
    for name, program in programs.items():
        # its namespace is before the name, and a number after it
        if name.rsplit("/", 1)[-1].startswith(RECORDER):
            return 0 if program.returncode == 0 else 1
    return 1 if any(deaths.status_of.values()) else 0
