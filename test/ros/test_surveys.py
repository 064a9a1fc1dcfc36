#!/usr/bin/env python3
"""Short surveys end to end: simulate, launch what is shipped, look at what it leaves behind."""

import contextlib
import json
import os
import re
import resource
import shlex
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
import unittest
import xmlrpc.client
from pathlib import Path

import numpy as np
import psutil
import rosbag
import rosgraph
import rospkg
import rospy
import rostest
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseWithCovarianceStamped
from std_srvs.srv import Trigger

from rbpf_svgp_slam import _journal
from rbpf_svgp_slam.msg import FilterStatus
from rbpf_svgp_slam.run.tracks import read_tum, write_tum
from rbpf_svgp_slam.srv import GetMinibatches, GetMinibatchesRequest

PACKAGE = Path(rospkg.RosPack().get_path("rbpf_svgp_slam"))
sys.path.insert(0, str(PACKAGE / "test" / "python"))
import sonar_files  # noqa: E402
from outsider_bag import ODOMETRY, TRUTH, write_outsider_bag  # noqa: E402

DOCUMENT = (PACKAGE / "docs" / "your_survey.md").read_text()
REPORT_FIELDS = (
    "particles nodes seed pings pings_dropped beams duration_s wall_s real_time_factor "
    "iterations_total iterations_per_particle iterations_per_s loop_closure_prompts resamplings "
    "ate_rmse_m dr_ate_rmse_m final_error_m dr_final_error_m map_rmse_m map_msll "
    "consistency_rmse_m grid_rmse_m peak_rss_mb maps_moved bytes_moved prompt_s_median "
    "resampling_s_median rpe_rmse_m dr_rpe_rmse_m map_consistency_rmse_m sampled_map_rmse_m"
).split()
# J is not divisible by B. Tiny maps; every prompt that tells particles apart resamples.
SMALL = {
    # test_live_until_saved plays eight times too fast without /clock
    "clock": {"max_ahead_s": 1e4},
    "particles": 5,
    "nodes": 2,
    "motion": {"surge_std_m": 0.2, "sway_std_m": 0.2, "yaw_std_rad": 0.0005},
    "mapping": {"hold_back_s": 10.0},
    "svgp": {
        "inducing_points": 64,
        "minibatch_size": 100,
        "convergence": {"window": 20, "tolerance": 1.0},
    },
    "lc": {"rate_hz": 1.0, "min_overlap": 0.1, "mapped_variance": 0.5, "veto_sigma": 20.0},
    "resampling": {"threshold": 1.0},
    "offline": {"steps_per_second": 20.0},
    "output": {"final_training_s": 1.0},
}

#: roslaunch with an exit status that tells how it went.
RUN_LAUNCH = ["rosrun", "rbpf_svgp_slam", "run_launch.py"]
#: Bytes, of which a survey's pings take five times as many.
JOURNAL_FITS = 100_000
#: Of data; a core of such a survey has less than half of that.
MEMORY_LIMIT_MB = 1000


class AnnouncesGigabytes(GetMinibatchesRequest):
    """Of some particles, whose array has 2 GB by what its length says."""

    def serialize(self, buff):
        buff.write(struct.pack("<2I", 2**29, 0))


def launch(file, *args, timeout_s=120):
    """Run a shipped launch file to its end; its exit status and output."""
    command = ["roslaunch", "--no-summary", "rbpf_svgp_slam", file, *args]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    with subprocess.Popen(command, **pipes) as running:
        try:
            output, _ = running.communicate(timeout=timeout_s)
        except subprocess.TimeoutExpired:
            # not killed: roslaunch must take its nodes with it
            running.send_signal(signal.SIGINT)
            output, _ = running.communicate()
            output += f"\nstill running after {timeout_s} s"
        return running.returncode, output


@contextlib.contextmanager
def running_launch(file, *args):
    """A launch file that goes on, and its output; ended, if need be, when it is left."""
    with tempfile.NamedTemporaryFile(suffix=".log") as log:
        command = ["roslaunch", "--no-summary", "rbpf_svgp_slam", file, *args]
        process = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT)
        try:
            yield process, Path(log.name)
        finally:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
                process.wait()


def commands_of(text):
    """The lines of the blocks of code that have no kind."""
    blocks = re.findall(r"^```(\w*)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    return [line for kind, block in blocks if not kind for line in block.splitlines()]


def pid_of(node):
    uri = rosgraph.Master("/test_surveys").lookupNode(node)
    _, _, pid = xmlrpc.client.ServerProxy(uri).getPid("/test_surveys")
    return pid


def limit_files(pid, size):
    """In place of a full disk: files of a process that may not grow beyond it. The limit before."""
    before, most = resource.prlimit(pid, resource.RLIMIT_FSIZE)
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (size, most))
    return before


class Surveys(unittest.TestCase):
    """Each case runs one launch file on a survey of two minutes."""

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        path = Path(cls.folder.name)
        cls.bag = path / "survey.bag"
        simulate = ["rosrun", "rbpf_svgp_slam", "simulate_survey.py", "--mission", "demo"]
        subprocess.run([*simulate, "--scale", "0.06", "--out", cls.bag], check=True)
        cls.small = path / "small.yaml"
        cls.small.write_text(yaml.safe_dump(SMALL))
        cls.survey = path / "survey.survey.yaml"

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def setUp(self):
        self.config = self.small
        self.out = Path(self.folder.name) / self.id().rsplit(".", 1)[-1]
        # the master is common to all cases; parameters of one must not be seen by the next
        master = rosgraph.Master("/test_surveys")
        for name in ("/rbpf_svgp_slam", "/use_sim_time", "/rbpf_core", "/survey_recorder"):
            if master.hasParam(name):
                master.deleteParam(name)

    def common_args(self):
        return [f"config:={self.config}", f"survey:={self.survey}", f"out:={self.out}"]

    def check_run_folder(self, output="", figures=True):
        self.assertTrue((self.out / "report.json").is_file(), output)
        report = json.loads((self.out / "report.json").read_text())
        self.assertEqual([name for name in REPORT_FIELDS if name not in report], [])
        self.assertEqual((report["particles"], report["nodes"]), (5, 2))
        self.assertEqual(report["pings_dropped"], 0)
        self.assertGreater(report["pings"], 300)
        self.assertGreater(report["iterations_total"], 500)
        for name in ("ate_rmse_m", "dr_ate_rmse_m", "map_rmse_m", "consistency_rmse_m"):
            self.assertIsNotNone(report[name], name)
        # two minutes of drift: the filter may be better or worse, not lost
        self.assertLess(report["ate_rmse_m"], 3 * report["dr_ate_rmse_m"] + 5.0)
        # a figure has more than the page's text
        self.assertEqual((self.out / "report.html").stat().st_size > 100_000, figures)
        for name in ("online_ate_rmse_m", "nees_skipped", "online_nees"):
            self.assertIsNotNone(report[name], name)
        for name in ("trajectory", "online", "dead_reckoning", "ground_truth"):
            stamp_s, _ = read_tum(self.out / f"{name}.tum")
            # the ground truth, at 10 Hz, may end before the last ping
            self.assertAlmostEqual(len(stamp_s), report["pings"], delta=2)
        with np.load(self.out / "map.npz") as grid:
            self.assertEqual(grid["mean"].shape, (len(grid["x"]), len(grid["y"])))
            known = np.isfinite(grid["mean"])
            self.assertGreater(known.mean(), 0.9)
            # the simulated seabed lies between 10 m and 60 m of depth
            self.assertTrue(np.all((grid["mean"][known] < -5) & (grid["mean"][known] > -80)))
            self.assertTrue(np.all(grid["variance"][known] > 0))
        return report

    def test_replay(self):
        status, output = launch("replay.launch", f"bag:={self.bag}", *self.common_args(), "rate:=8")
        self.assertEqual(status, 0, output)
        report = self.check_run_folder(output)
        self.assertGreater(report["loop_closure_prompts"], 0, output)
        self.assertGreater(report["resamplings"], 0, output)
        # A status is sent once a second: of these times some are missed, never all.
        self.assertGreater(report["prompt_s_median"], 0.0)
        self.assertGreater(report["resampling_s_median"], 0.0)
        self.assertRegex(output, r"replay .* %, ETA \d\d:\d\d")
        self.assertIn("RBPF error: online ATE", output)
        self.check_journal_gives_the_run()

    def check_journal_gives_the_run(self):
        """The filter, run once more, is the one that was live: to the last digit written."""
        survey = _journal.read(str(self.out / "survey.journal"))
        with np.load(self.out / "survey.npz") as written:
            for name in "stamp_s held_out beams_per_ping levelled online_covariance".split():
                np.testing.assert_array_equal(survey[name], written[name], name)
        again = self.out / "again.tum"
        for name in ("estimate", "online", "dead_reckoning"):
            write_tum(again, survey["stamp_s"], survey[name])
            file = "trajectory" if name == "estimate" else name
            self.assertEqual(again.read_bytes(), (self.out / f"{file}.tum").read_bytes(), file)

    def test_offline_loses_nothing(self):
        status, output = launch("offline.launch", f"bag:={self.bag}", *self.common_args())
        self.assertEqual(status, 0, output)
        report = self.check_run_folder(output)
        pings = int(
            re.search(
                r"(\d+) msgs\s*: sensor_msgs/PointCloud2",
                subprocess.run(["rosbag", "info", self.bag], capture_output=True, text=True).stdout,
            ).group(1)
        )
        self.assertEqual(report["pings"], pings)

    def test_an_outsider_s_bag_goes_the_document_s_way(self):
        folder = Path(self.folder.name) / "outsider"
        folder.mkdir()
        write_outsider_bag(folder / "survey.bag", beams=64)
        before, rest = DOCUMENT.split("## A sonar's own files\n")
        commands = commands_of(before + rest.split("\n## ", 1)[1])
        self.assertEqual(len(commands), 5)
        # SMALL only saves time; its noise is not what the overlay says
        effort = {k: v for k, v in SMALL.items() if k != "motion"}
        (folder / "effort.yaml").write_text(yaml.safe_dump(effort))
        more = f"survey:=$PWD/effort.yaml ground_truth_topic:={TRUTH}"
        for command in commands:
            command = command.replace("/nav/odometry", ODOMETRY)
            if command.startswith("roslaunch "):
                documented, command = shlex.split(command), f"{command} {more}"
            output = self.run_documented(command, folder)
            if " check_bag.py survey.bag survey.check.yaml" in command:
                printed = shlex.split(output.splitlines()[-1])
        # of another folder, and by whole names
        written = [word.replace("$PWD", str(folder)) for word in documented if "out:" not in word]
        self.assertEqual(sorted(set(written) - set(printed)), [])
        self.assertTrue((folder / "out" / "export" / "seabed.tif").is_file())
        report = json.loads((folder / "out" / "report.json").read_text())
        self.assertEqual(report["pings"], 416, output)  # every twelfth of 5000 odometry messages
        self.assertEqual(report["velocity_source"], "pose")
        self.assertEqual(report["refused"], {})
        # 0.06 m per sqrt(s) over 100 s
        self.assertLess(report["ate_rmse_m"], 2.0)
        self.assertGreater(report["loop_closure_prompts"], 0, output)

    def test_a_sonar_s_file_is_mapped_the_document_s_way(self):
        folder = Path(self.folder.name) / "sonar"
        folder.mkdir()
        # in place of the clip; a model is learned from 4000 beams or more, of 31 a ping
        (folder / "clip.xtf").write_bytes(sonar_files.xtf(40.0))
        section = DOCUMENT.split("## A sonar's own files\n")[1].split("\n## ")[0]
        commands = commands_of(section)
        mapping, drifting = (c for c in commands if c.startswith("roslaunch "))
        self.run_documented(commands[0], folder)
        survey = yaml.safe_load((folder / "clip.survey.yaml").read_text())
        no_figures = {**survey, "output": {"figures": False}}
        (folder / "clip.survey.yaml").write_text(yaml.safe_dump(no_figures))
        self.run_documented(mapping, folder)
        with np.load(folder / "clip" / "map.npz") as grid:
            median_m = np.nanmedian(grid["mean"])
        # a flat seabed; the travel time comes in microseconds
        self.assertAlmostEqual(median_m, -sonar_files.DEPTH_M, delta=0.02)
        self.assertTrue((folder / "clip" / "export" / "seabed.bag").is_file())
        self.setUp()  # parameters
        effort = {**SMALL, "output": {**SMALL["output"], "figures": False}}
        (folder / "clip.survey.yaml").write_text(yaml.safe_dump({**survey, **effort}))
        self.run_documented(drifting, folder)
        report = json.loads((folder / "drifting" / "report.json").read_text())
        # 0.08 m per sqrt(s) along and across: the good navigation is the ground truth
        self.assertTrue(0.01 < report["dr_ate_rmse_m"] < 2.0)
        self.assertIsNotNone(report["ate_rmse_m"])

    def run_documented(self, command, folder):
        """As a shell runs it there; its output."""
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
        done = subprocess.run(["bash", "-c", command], cwd=folder, timeout=120, **pipes)
        self.assertEqual(done.returncode, 0, f"{command}\n{done.stdout}")
        return done.stdout

    def test_the_other_ways_to_learn(self):
        for name, changes in (
            ("adam", {"optimizer": "adam"}),
            ("natgrad", {"optimizer": "natgrad"}),
            ("shared", {"optimizer": "natgrad", "shared_hyperparameters": True}),
        ):
            with self.subTest(name):
                self.out = Path(self.folder.name) / name
                self.config = Path(self.folder.name) / f"{name}.yaml"
                # to figures the maps of all three are of one kind
                figures = name == "adam"
                svgp = {**SMALL["svgp"], **changes}
                overlay = {"svgp": svgp, "output": {**SMALL["output"], "figures": figures}}
                self.config.write_text(yaml.safe_dump({**SMALL, **overlay}))
                args = [f"bag:={self.bag}", *self.common_args(), "check:=false"]
                status, output = launch("offline.launch", *args)
                self.assertEqual(status, 0, output)
                report = self.check_run_folder(output, figures)
                self.assertGreater(report["resamplings"], 0, output)
                # loop closures may be
                self.assertNotRegex(re.sub("Closures:.*", "", output), "failed|refused|undone")

    def test_live_until_saved(self):
        running = subprocess.Popen([*RUN_LAUNCH, "slam.launch", *self.common_args()])
        try:
            rospy.wait_for_service("/survey_recorder/save_so_far", 60)
            for name in ("save_so_far", "export"):
                early = rospy.ServiceProxy(f"/survey_recorder/{name}", Trigger)()
                self.assertFalse(early.success, early.message)
            self.give_the_start()
            rospy.wait_for_service("/rbpf_core/get_pings", 60)
            self.check_second_launch()
            limit_files(pid_of("/rbpf_core"), JOURNAL_FITS)
            play = ["rosbag", "play", "-q", "-r", "8", "--queue", "10000", "--wait-for-subscribers"]
            topics = ["/odom", "/mbes/pings", "/ground_truth", "/tf", "/tf_static"]
            subprocess.run([*play, "--topics", *topics, "--bags", self.bag], check=True)
            time.sleep(2.0)
            so_far = rospy.ServiceProxy("/survey_recorder/save_so_far", Trigger)()
            self.assertTrue(so_far.success, so_far.message)
            report = self.check_run_folder(so_far.message)
            self.assertIn("still going on", report["provenance"]["survey_end"])
            self.assertEqual(sorted(self.out.glob(".*")), [], "what was written aside")
            self.check_full_disk()
            export = rospy.ServiceProxy("/survey_recorder/export", Trigger)()
            self.assertFalse(export.success)
            self.assertIn("survey_origin is not set", export.message)
            self.assertTrue(rospy.ServiceProxy("/survey_recorder/save", Trigger)().success)
            # the report; reached only by a bug, or on a busy machine
            self.assertEqual(running.wait(120), 0)
            self.check_run_folder()
            self.check_journal_that_did_not_fit(report["pings"])
        finally:
            running.terminate()
            running.wait(30)

    def give_the_start(self):
        """As RViz does it before the bag is played: by this computer's clock, not by the bag's."""
        with rosbag.Bag(self.bag) as bag:
            _, first, _ = next(bag.read_messages("/odom"))
        given = PoseWithCovarianceStamped(pose=first.pose)
        given.header.frame_id, given.header.stamp = "map", rospy.Time.now()
        given.pose.covariance = [1e-6 * (i in (0, 7, 35)) for i in range(36)]
        start = rospy.Publisher("/initialpose", PoseWithCovarianceStamped, queue_size=1, latch=True)
        deadline_s = time.monotonic() + 60
        while not start.get_num_connections() and time.monotonic() < deadline_s:
            time.sleep(0.05)
        start.publish(given)

    def check_second_launch(self):
        """On the same master: none of its nodes takes the name of one that runs."""
        nodes = ["/rbpf_core", "/survey_recorder"]
        before = [pid_of(node) for node in nodes]
        second = [*self.common_args()[:2], f"out:={self.out}_second"]
        self.assertRegex(launch("slam.launch", *second)[1], "runs already, at http://")
        recorder = ["rosrun", "rbpf_svgp_slam", "survey_recorder.py"]
        refused = subprocess.run(recorder, stderr=subprocess.PIPE, text=True, timeout=60)
        self.assertEqual(refused.returncode, 1)
        self.assertRegex(refused.stderr, "survey_recorder runs already, at http://")
        self.assertEqual([pid_of(node) for node in nodes], before)

    def check_full_disk(self):
        """What was written last stays, and who asks is told; the journal's end is diagnosed."""
        saved = {path.name: path.read_bytes() for path in self.out.iterdir() if path.is_file()}
        recorder = pid_of("/survey_recorder")
        unlimited = limit_files(recorder, 1000)
        so_far = rospy.ServiceProxy("/survey_recorder/save_so_far", Trigger)()
        limit_files(recorder, unlimited)
        self.assertFalse(so_far.success)
        self.assertIn("File too large", so_far.message)
        self.assertEqual([path for path in self.out.glob(".*")], [], "what was written aside")
        for name, content in saved.items():
            self.assertEqual((self.out / name).read_bytes(), content, name)
        ended = self.diagnosed("journal", lambda d: d.level == DiagnosticStatus.ERROR)
        self.assertIn("the journal has ended: File too large", ended.message)

    def check_journal_that_did_not_fit(self, pings):
        """SLAM has gone on without it, and it is whole up to there."""
        report = json.loads((self.out / "report.json").read_text())
        self.assertEqual(report["health"]["journal"], "File too large")
        self.assertEqual((self.out / "survey.journal").stat().st_size, JOURNAL_FITS)
        survey = _journal.read(str(self.out / "survey.journal"))
        self.assertIn("the file ends within a record", survey["why_lost"])
        written = len(survey["stamp_s"])
        self.assertTrue(20 < written < pings / 2, f"{written} of {pings}")
        _, estimate = read_tum(self.out / "online.tum")
        np.testing.assert_allclose(survey["online"], estimate[:written], atol=1e-6)

    def test_a_survey_survives_its_core_and_then_its_launch(self):
        args = ["replay.launch", f"bag:={self.bag}", *self.common_args(), "rate:=4"]
        with running_launch(*args, f"memory_limit_mb:={MEMORY_LIMIT_MB}") as (replay, log):
            status = self.status_with(lambda s: s.prompts > 0 and s.pings > 100, log)
            with self.assertRaises(rospy.ServiceException):
                rospy.ServiceProxy("/rbpf_core/get_minibatches", GetMinibatches)(
                    AnnouncesGigabytes()
                )
            status = self.status_with(lambda s: s.pings > status.pings, log)
            self.assertLess(status.peak_rss_mb, MEMORY_LIMIT_MB)
            os.kill(pid_of("/rbpf_core"), signal.SIGKILL)
            before, status = status, self.status_with(lambda s: s.pings > status.pings + 30, log)
            status = self.stop_a_map_node(status, log)
            replay.send_signal(signal.SIGINT)
            self.assertEqual(replay.wait(60), 0)
            output = log.read_text()
        self.assertIn("rbpf_core was killed by SIGKILL: it is started again", output)
        resumed = int(re.search(r"Resumed .*survey.journal: (\d+) pings", output).group(1))
        # a ping is safe as soon as it is taken in
        self.assertGreaterEqual(resumed, before.pings)
        # of the prompt that it may have died in nothing is known
        self.assertGreaterEqual(status.prompts, before.prompts - 1)
        self.assertGreaterEqual(status.epoch, before.epoch)
        self.assertEqual((status.resumed, status.journal), (1, "kept"))
        # and so is the run once the launch has ended before its time
        self.assertFalse((self.out / "report.json").exists())
        recover = ["rosrun", "rbpf_svgp_slam", "recover_run.py", self.out]
        recovered = subprocess.run(recover, capture_output=True, text=True)
        self.assertEqual(recovered.returncode, 0, recovered.stdout + recovered.stderr)
        report = json.loads((self.out / "report.json").read_text())
        self.assertGreaterEqual(report["pings"], status.pings)
        self.assertEqual(report["health"]["core_resumed"], 1)
        self.assertIsNotNone(report["ate_rmse_m"])
        self.setUp()  # parameters
        args = [*self.common_args()[:2], f"resume:={self.out}"]
        with running_launch("slam.launch", *args) as (_, log):
            resumed = self.status_with(lambda s: s.pings > 0, log)
            rospy.wait_for_service("/survey_recorder/save", 60)  # the run there is its own
        self.assertEqual(resumed.pings, report["pings"])
        # another survey must not be written over it by mistake
        again = subprocess.run(
            [*RUN_LAUNCH, "slam.launch", *self.common_args()],
            capture_output=True,
            text=True,
            timeout=60,
        )
        self.assertIn("survey.journal is there already", again.stdout + again.stderr)
        self.assertEqual(again.returncode, 1)

    def test_a_survey_ends_saved_if_its_launch_s_own_master_dies(self):
        self.check_end_without_master(brings_master=True, why="master was killed by SIGKILL")

    def test_a_survey_ends_saved_if_another_s_master_dies(self):
        self.check_end_without_master(brings_master=False, why="No report: the master .* has died")

    def check_end_without_master(self, brings_master, why):
        """On a master of its own, which is killed amid the survey."""
        with socket.socket() as free:
            free.bind(("localhost", 0))
            port = str(free.getsockname()[1])
        environment = {**os.environ, "ROS_MASTER_URI": f"http://localhost:{port}"}
        play = "rosbag play -q -r 8 --queue 10000 --wait-for-subscribers --topics".split()
        play += ["/odom", "/mbes/pings", "/tf", "/tf_static", "--bags", self.bag]
        with contextlib.ExitStack() as started, tempfile.NamedTemporaryFile(suffix=".log") as log:

            def start(command, **pipes):
                process = subprocess.Popen(command, env=environment, **pipes)
                started.callback(process.wait)
                started.callback(process.terminate)
                return psutil.Process(process.pid), process

            if not brings_master:
                master, _ = start(["rosmaster", "--core", "-p", port])
            command = [*RUN_LAUNCH, "slam.launch", *self.common_args()]
            launched, running = start(command, stdout=log, stderr=subprocess.STDOUT)
            self.await_start(environment["ROS_MASTER_URI"], log)
            start(play)
            self.await_journal(200_000, log)
            processes = launched.children(recursive=True)
            if brings_master:
                [master] = [p for p in processes if any("rosmaster" in a for a in p.cmdline()[:2])]
            master.kill()
            self.assertEqual(running.wait(60), 1, Path(log.name).read_text())
            self.assertRegex(Path(log.name).read_text(), why)
            self.assertEqual([p for p in processes if p.is_running()], [])
        recover = ["rosrun", "rbpf_svgp_slam", "recover_run.py", self.out]
        recovered = subprocess.run(recover, capture_output=True, text=True)
        self.assertEqual(recovered.returncode, 0, recovered.stdout + recovered.stderr)
        report = json.loads((self.out / "report.json").read_text())
        self.assertGreater(report["pings"], 20)

    def await_start(self, master_uri, log):
        def has_started():
            try:
                *_, services = rosgraph.Master("/test_surveys", master_uri).getSystemState()
            except OSError:
                return False
            names = {name for name, _ in services}
            return names >= {"/survey_recorder/save", "/svgp_node_1/predict"}

        self.await_that(has_started, log)

    def await_journal(self, size, log):
        journal = self.out / "survey.journal"
        self.await_that(lambda: journal.is_file() and journal.stat().st_size > size, log)

    def await_that(self, holds, log):
        deadline_s = time.monotonic() + 60
        while not holds():
            self.assertLess(time.monotonic(), deadline_s, Path(log.name).read_text())
            time.sleep(0.1)

    def stop_a_map_node(self, before, log):
        """It hangs: /diagnostics says so, by its name, and pings go on. Returns a later status."""
        pid = pid_of("/svgp_node_1")
        os.kill(pid, signal.SIGSTOP)
        try:
            silent = self.diagnosed("maps", lambda d: d.level == DiagnosticStatus.ERROR, log)
            self.assertIn("svgp_node_1 not heard of for", silent.message)
            well = self.diagnosed("input", lambda d: d.level == DiagnosticStatus.OK, log)
            self.assertEqual(well.message, "odometry: coming in; pings: coming in")
            after = self.status_with(lambda s: s.pings > before.pings, log)
        finally:
            os.kill(pid, signal.SIGCONT)
        well = self.diagnosed("maps", lambda d: d.level == DiagnosticStatus.OK, log)
        self.assertIn("of 5 maps are ready", well.message)
        return after

    def diagnosed(self, name, is_wanted, log=None):
        """The first of these diagnostics of the core that is wanted."""
        found = []

        def keep(array):
            found.extend(d for d in array.status if d.name.endswith(f": {name}") and is_wanted(d))
            return found

        self.message_with("/diagnostics", DiagnosticArray, keep, log)
        return found[0]

    def status_with(self, is_wanted, log):
        """The first status of the core that is wanted."""
        return self.message_with("/rbpf_core/status", FilterStatus, is_wanted, log)

    def message_with(self, topic, message_class, is_wanted, log=None, patience_s=60):
        """The first message of a topic that is wanted."""
        found = []

        def take(message):
            if not found and is_wanted(message):
                found.append(message)

        subscriber = rospy.Subscriber(topic, message_class, take)
        deadline_s = time.monotonic() + patience_s
        while not found and time.monotonic() < deadline_s:
            time.sleep(0.05)
        subscriber.unregister()
        self.assertTrue(found, log.read_text() if log else topic)
        return found[0]

    def test_wrong_parameters_stop_the_start(self):
        wrong = {
            "particels": (40, "particels"),
            "lc": ({"rate_hz": -1.0}, "lc/rate_hz"),
            "pings": ({"outlier_window": 4}, "pings/outlier_window"),
            "svgp": ({"kernel": "rbf"}, "svgp/kernel"),
        }
        for group, (value, name) in wrong.items():
            self.setUp()
            self.config.with_name("wrong.yaml").write_text(yaml.safe_dump({**SMALL, group: value}))
            _, output = launch(
                "slam.launch",
                f"config:={self.config.with_name('wrong.yaml')}",
                f"survey:={self.survey}",
                timeout_s=60,
            )
            self.assertRegex(output, f"{name} is .*expected", f"{group}: {value}")

    def test_shipped_configurations_are_accepted(self):
        for overlay in sorted((PACKAGE / "config").glob("*.yaml")):
            self.setUp()
            running = subprocess.Popen(
                ["roslaunch", "--no-summary", "rbpf_svgp_slam", "slam.launch"]
                + [f"config:={overlay}", f"survey:={self.survey}"],
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
            )
            try:
                # each node advertises its services only once its parameters are accepted
                for service in ("/rbpf_core/get_pings", "/svgp_node_0/predict"):
                    rospy.wait_for_service(service, timeout=40)
            except rospy.ROSException:
                running.terminate()
                self.fail(f"{overlay.name}: {running.communicate()[0]}")
            finally:
                running.terminate()
                running.communicate(timeout=30)


if __name__ == "__main__":
    rospy.init_node("test_surveys")
    rostest.rosrun("rbpf_svgp_slam", "surveys", Surveys, sys.argv)
