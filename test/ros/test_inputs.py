#!/usr/bin/env python3
"""Bags as other people have them, against running nodes; and processes that are killed.

tools/inputs.sh runs all cases. These are some of each kind: what is harmless stands together in two
bags, and what stops a run does so within seconds.
"""

import contextlib
import re
import sys
import tempfile
import time
import unittest
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import psutil
import rosgraph
import rostest
from bag_cases.expected import RIGHT, Case
from bag_cases.registry import CASES
from input_runs import LIVE, OFFLINE, Workshop, problems

RUNS = (
    ("harmless_together", OFFLINE),
    ("harmless_together", LIVE),
    ("unusual_together", OFFLINE),
    ("twist_empty", LIVE),
    ("rates_in_degrees", OFFLINE),
    ("twist_in_odom_frame", OFFLINE),
    ("clock_set_late", LIVE),
    ("sonar_hour_ahead", OFFLINE),
    ("pings_z_down", LIVE),
    ("utm_area_local", OFFLINE),
    ("no_mount", OFFLINE),
    ("in_a_namespace", LIVE),
    ("pings_of_another_type", LIVE),
    ("cut_off_bag", OFFLINE),
    ("pause_in_recording", LIVE),
)
#: Runs at a time: each waits more than it computes.
JOBS = 2
#: For a process to come up, and for a run that has lost one to end.
PATIENCE_S = 60.0
UNDER_WAY_S = 3.0
MAP_NODE_DEAD = r"svgp_node_0 ended with exit status -9[\s\S]*svgp_nodes-\d+ has died"


def kill(program, launch_pid):
    """SIGKILL for the launch's process whose command has this word, once the run is under way."""
    launch = psutil.Process(launch_pid)
    give_up_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < give_up_s:
        process = child_of(launch, program)
        # a process has no environment for a moment in which it becomes another program
        uri = launch.environ().get("ROS_MASTER_URI")
        if process and uri and is_known(rosgraph.Master("/test_inputs", uri), "/survey_recorder"):
            time.sleep(UNDER_WAY_S)
            process.kill()
            return
        time.sleep(0.1)
    raise AssertionError(f"{program} or the recorder has not come up")


def child_of(launch, program):
    for process in launch.children(recursive=True):
        with contextlib.suppress(psutil.Error):  # it has just ended
            if any(re.search(rf"(^|/){program}$", word) for word in process.cmdline()):
                return process
    return None


def is_known(master, node):
    """The node is past its start. The master itself may not be there yet."""
    try:
        return bool(master.lookupNode(node))
    except (OSError, rosgraph.MasterError):
        return False


class InputsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.workshop = Workshop(Path(cls.folder.name))
        # to their ends: whoever kills needs processes that come up at their usual pace
        with ThreadPoolExecutor(JOBS) as pool:
            cls.runs = {
                (name, mode): pool.submit(cls.workshop.run, CASES[name], mode)
                for name, mode in RUNS
            }

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def check_case(self, name, mode):
        survey, run = self.runs[name, mode].result()
        wrong = problems(CASES[name], mode, survey, run)
        self.assertEqual([], wrong, f"\n{run.last_lines}")

    def check_death(self, program, told, mode=LIVE):
        """A process is killed: the run ends by itself, and its last lines name who has died."""
        # offline a second of survey then takes about as long
        slow = {"offline": {"steps_per_second": 2000.0}}
        case = Case(
            f"{program}_killed_{mode}",
            "ends",
            "",
            lambda survey: survey.replace(overlay={**survey.overlay, **slow}),
            RIGHT,
        )
        begin_s = time.monotonic()
        _, run = self.workshop.run(case, mode, lambda pid: kill(program, pid), rate=1)
        self.assertIsNotNone(run.status, f"it has not ended:\n{run.output}")
        self.assertNotEqual(run.status, 0, run.output)
        self.assertLess(time.monotonic() - begin_s, PATIENCE_S, run.output)
        self.assertRegex(run.last_lines, told)

    def test_the_player_is_killed(self):
        self.check_death(
            "play_survey.py", "No report: .*player.*\n.*player-\\d+ was killed by SIGKILL"
        )

    def test_who_keeps_the_core_is_killed(self):
        """The core alone: test_surveys.py."""
        self.check_death("keep_core.py", "rbpf_core-\\d+ was killed by SIGKILL")

    def test_a_map_node_is_killed(self):
        """Another one takes its place, and all goes on."""
        case = Case("map_node_killed", "completes", "", lambda survey: survey, RIGHT)
        survey, run = self.workshop.run(case, LIVE, lambda pid: kill("svgp_node.py", pid), rate=3)
        self.assertEqual(run.status, 0, run.output)
        self.assertIn("svgp_node_0 was killed by SIGKILL: it is started again", run.output)
        self.assertEqual(run.report["pings"], len(survey.of(survey.ping_topic)), run.last_lines)
        health = run.report["health"]
        self.assertEqual(health["pings_dropped"], 0)
        self.assertEqual(health["map_nodes_restarted"], 1)
        self.assertEqual((health["core_resumed"], health["journal"]), (0, "kept"))

    def test_a_map_node_of_an_offline_replay_is_killed(self):
        self.check_death("svgp_node.py", MAP_NODE_DEAD, OFFLINE)


def _test_of(name, mode):
    return lambda self: self.check_case(name, mode)


for _name, _mode in RUNS:
    setattr(InputsTest, f"test_{_name}_{_mode}", _test_of(_name, _mode))

if __name__ == "__main__":
    rostest.rosrun("rbpf_svgp_slam", "inputs", InputsTest, sys.argv)
