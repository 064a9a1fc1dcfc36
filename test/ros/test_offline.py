#!/usr/bin/env python3
"""Offline replays repeat themselves to the byte, whatever the machine does meanwhile."""

import json
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

import numpy as np
import rosbag
import rosgraph
import rospy
import rostest
import yaml
from sensor_msgs.msg import PointCloud2

from rbpf_svgp_slam.msg import MapStatus
from rbpf_svgp_slam.protocol.payload import split
from rbpf_svgp_slam.srv import GetMaps

MASTER = rosgraph.Master("/test_offline")
PATIENCE_S = 120.0  # with a replay of seconds; reached only by a bug
RECEIVED_LATE_S = 5.0  # at most, in the bag whose messages were received in another order
# Of the run folder, that must be the same to the byte.
FILES = ("trajectory.tum", "online.tum", "map.npz", "export/seabed.xyz", "export/trajectory.sbet")
FILES += ("survey.npz", "history.npz", "time_lapse.npz")
# J is not divisible by B. Tiny maps; nearly every prompt resamples.
SMALL = {
    "particles": 5,
    "survey_origin": [57.5, 11.2],
    "motion": {"surge_std_m": 0.2, "sway_std_m": 0.2, "yaw_std_rad": 0.0005},
    "mapping": {"hold_back_s": 10.0},
    "map": {"publish_period_s": 0.1},
    "lc": {"rate_hz": 0.5, "min_overlap": 0.1, "mapped_variance": 0.5, "veto_sigma": 20.0},
    "resampling": {"threshold": 1.0},
    "offline": {"steps_per_second": 20.0},
    "output": {"final_training_s": 2.0, "time_lapse_period_s": 10.0},
}
SVGP = {
    "inducing_points": 36,
    "minibatch_size": 100,
    "convergence": {"window": 20, "tolerance": 1.0},
}
GMRF = {"map": {**SMALL["map"], "engine": "gmrf"}}


def svgp(optimizer):
    return {"svgp": {**SVGP, "optimizer": optimizer}}


def shuffle_receipt(bag, shuffled):
    """The same messages, received in another order."""
    rng = random.Random(1)
    with rosbag.Bag(bag) as source, rosbag.Bag(shuffled, "w") as target:
        for topic, message, received in source.read_messages():
            late_s = rng.uniform(0.0, RECEIVED_LATE_S)
            target.write(topic, message, received + rospy.Duration(late_s))


def all_maps(nodes):
    """Bytes of every particle's map, once the replay has ended."""
    maps = {}
    for k in range(nodes):
        name = f"/svgp_node_{k}"
        status = rospy.wait_for_message(f"{name}/status", MapStatus, PATIENCE_S)
        reply = rospy.ServiceProxy(f"{name}/get_maps", GetMaps)(status.epoch, status.particles)
        assert reply.success, reply.message
        maps.update(zip(status.particles, split("maps", reply.maps, reply.sizes)))
    return maps


class OfflineTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.path = Path(cls.folder.name)
        cls.bag, cls.shuffled = cls.path / "survey.bag", cls.path / "shuffled.bag"
        simulate = ["rosrun", "rbpf_svgp_slam", "simulate_survey.py", "--mission", "demo"]
        subprocess.run([*simulate, "--scale", "0.05", "--out", cls.bag], check=True)
        shuffle_receipt(cls.bag, cls.shuffled)
        # Somebody who looks at the maps must not change them.
        cls.pictures = []
        cls.viewer = rospy.Subscriber("/map/mean", PointCloud2, cls.pictures.append)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def replay(self, name, bag, nodes, maps_of, seed=1):
        """Both estimates, the map and every particle's map, as bytes.

        maps_of: parameters of the maps.
        """
        for parameter in ("/rbpf_svgp_slam", "/rbpf_core", "/survey_recorder"):
            if MASTER.hasParam(parameter):
                MASTER.deleteParam(parameter)  # of the replay before, on the same master
        out, config = self.path / name, self.path / f"{name}.yaml"
        # one report of GMRF maps is drawn, too
        output = {**SMALL["output"], "figures": maps_of is GMRF and not name.endswith("_again")}
        overlay = {**maps_of, "output": output, "nodes": nodes, "seed": seed}
        config.write_text(yaml.safe_dump({**SMALL, **overlay}))
        survey = self.path / "survey.survey.yaml"
        args = [f"bag:={bag}", f"out:={out}", f"config:={config}", f"survey:={survey}"]
        args.append("check:=false")  # nothing of it is left in what is compared
        log = self.path / f"{name}.log"
        with log.open("w") as output, subprocess.Popen(
            ["roslaunch", "--no-summary", "rbpf_svgp_slam", "offline.launch", *args],
            stdout=output,
            stderr=subprocess.STDOUT,
        ) as running:
            try:
                maps = self.maps_at_the_end(running, nodes)
                self.assertEqual(running.wait(PATIENCE_S), 0, log.read_text())
            except BaseException:
                # not killed: roslaunch must take its nodes with it
                running.send_signal(signal.SIGINT)
                print(log.read_text())
                raise
        self.assertEqual(sorted(maps), list(range(SMALL["particles"])))
        report = json.loads((out / "report.json").read_text())
        self.assertGreater(report["resamplings"], 5)
        self.assertEqual(report["pings_dropped"], 0)
        totals = re.search(r"s of survey in ([\d.]+) s, [\d.]+ x real time", log.read_text())
        self.assertAlmostEqual(report["wall_s"], float(totals.group(1)), delta=0.01)  # as printed
        self.assertGreater(min(map(len, maps.values())), 1000)
        self.check_record(out, report)
        return [(out / file).read_bytes() for file in FILES] + [maps]

    def check_record(self, out, report):
        """What is followed over the survey is of its own time, to the end."""
        with np.load(out / "history.npz") as history, np.load(out / "time_lapse.npz") as lapse:
            steps_s = np.diff(history["t_s"])
            # a row a second; the last one is of the end
            self.assertGreaterEqual(len(steps_s), 0.9 * report["duration_s"])
            self.assertTrue(np.all((steps_s[:-1] > 0.9) & (steps_s[:-1] < 1.2)), steps_s)
            for series in ("iterations_total", "resamplings", "loop_closure_prompts"):
                self.assertEqual(history[series][-1], report[series], series)
            self.assertGreater(len(lapse["t_s"]), report["duration_s"] / 20.0)
            self.assertGreater(np.isfinite(lapse["mean"][-1]).mean(), 0.2)

    def maps_at_the_end(self, running, nodes):
        deadline_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline_s and running.poll() is None:
            if rospy.get_param("/rbpf_core/replay_finished", False):
                return all_maps(nodes)
            time.sleep(0.1)
        raise AssertionError("the replay has not ended well")

    def check_repetition(self, nodes, maps_of):
        name = self._testMethodName
        first = self.replay(name, self.bag, nodes, maps_of)
        again = self.replay(f"{name}_again", self.shuffled, nodes, maps_of)
        for what, a, b in zip((*FILES, "the particles' maps"), first, again):
            self.assertTrue(a == b, f"{what} of two replays differ")
        return first

    def test_streaming_maps_on_two_nodes(self):
        first = self.check_repetition(2, svgp("streaming"))
        self.assertGreater(len(self.pictures), 0)
        other = self.replay("another_seed", self.bag, 2, svgp("streaming"), seed=2)
        for a, b in zip(first, other):
            self.assertTrue(a != b, "another seed, the same result")

    def test_streaming_maps_on_one_node(self):
        self.check_repetition(1, svgp("streaming"))

    def test_maps_that_learn_from_minibatches_on_two_nodes(self):
        self.check_repetition(2, svgp("adam"))

    def test_gmrf_maps_on_two_nodes(self):
        self.check_repetition(2, GMRF)


if __name__ == "__main__":
    rospy.init_node("test_offline")
    rostest.rosrun("rbpf_svgp_slam", "offline", OfflineTest, sys.argv)
