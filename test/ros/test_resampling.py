#!/usr/bin/env python3
"""Two real map nodes and a core played by this test: training, prediction and resampling."""

import signal
import subprocess
import time
import unittest

import numpy as np
import roslib.packages
import rospy
import rostest
from node_services import PATIENCE_S, at_once, service, wait_until
from nav_msgs.msg import OccupancyGrid
from rubbish import is_answered, rounds, rubbish_request
from sensor_msgs import point_cloud2
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from rbpf_svgp_slam import srv
from rbpf_svgp_slam.msg import FilterStatus, MapStatus
from rbpf_svgp_slam.protocol import names
from rbpf_svgp_slam.protocol.payload import pack, split, unpack

PARTICLES, NODES = 5, 2
OWN = [range(0, 3), range(3, 5)]
TIMEOUT_S = 2.0  # resampling/timeout_s
ROSLAUNCH_PATIENCE_S = 15.0  # after an interrupt; then it sends SIGTERM


class FakeCore:
    """Serves beams of a seabed that each particle sees at a depth of its own."""

    def __init__(self):
        self.survey = 7
        self.epoch = 0
        self.resampling = False
        self.beams_in_log = 0
        self.calls = 0
        self.beams_override = None
        self.advertise()

    def advertise(self):
        self.service = rospy.Service(
            "rbpf_core/get_minibatches", srv.GetMinibatches, self.get_minibatches
        )

    def get_minibatches(self, request):
        self.calls += 1
        if self.beams_in_log == 0:
            message = "the log is empty"
            return srv.GetMinibatchesResponse(success=False, message=message, survey=self.survey)
        xy = np.random.uniform([-20, -15], [20, 15], (len(request.particles), request.size, 2))
        depth_m = 20.0 + 3.0 * np.array(request.particles)
        z = np.sin(xy[:, :, 0] / 8) - depth_m[:, None]
        beams = pack(np.concatenate([xy, z[:, :, None]], axis=2))
        return srv.GetMinibatchesResponse(
            success=True,
            survey=self.survey,
            epoch=self.epoch,
            resampling=self.resampling,
            beams_in_log=self.beams_in_log,
            beams=beams if self.beams_override is None else self.beams_override,
        )


class ResamplingTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.status = {}
        cls.subscribers = [
            rospy.Subscriber(
                f"svgp_node_{k}/status", MapStatus, lambda m, k=k: cls.status.__setitem__(k, m)
            )
            for k in range(NODES)
        ]
        cls.core = FakeCore()
        cls.predict = [cls.of_survey(k, "predict", srv.PredictBeams) for k in range(NODES)]
        cls.prepare = [
            cls.of_survey(k, "prepare_resampling", srv.PrepareResampling) for k in range(NODES)
        ]
        cls.commit = [
            cls.of_survey(k, "commit_resampling", srv.CommitResampling) for k in range(NODES)
        ]
        cls.get_maps = [service(k, "get_maps", srv.GetMaps) for k in range(NODES)]

    @classmethod
    def of_survey(cls, k, name, service_class):
        call = service(k, name, service_class)
        return lambda *request: call(cls.core.survey, *request)

    def setUp(self):
        self.core.beams_in_log = 10000
        self.wait_for_training()

    # Steps of the protocol, as the core takes them

    def wait_for_training(self):
        """Every map takes further steps, under the core's epoch."""
        wait_until(lambda: len(self.status) == NODES, "status")
        before = {k: self.status[k] for k in range(NODES)}

        def advanced(k):
            now = self.status[k]
            pairs = zip(now.iterations, before[k].iterations)
            return (
                now.epoch == self.core.epoch
                and now.steps > before[k].steps
                and all(n != b for n, b in pairs)
            )

        wait_until(lambda: all(advanced(k) for k in range(NODES)), "training steps")

    def prepare_all(self, epoch, ancestors):
        self.core.resampling = True
        replies = at_once([lambda node=node: node(epoch, ancestors) for node in self.prepare])
        for reply in replies:
            self.assertTrue(reply.success, reply.message)
        return replies

    def all_maps(self, epoch):
        """Bytes of every particle's map."""
        maps = {}
        for k in range(NODES):
            reply = self.get_maps[k](epoch, list(OWN[k]))
            self.assertTrue(reply.success, reply.message)
            self.assertEqual(reply.engine, "svgp")
            maps.update(zip(OWN[k], split("maps", reply.maps, reply.sizes)))
        return maps

    def decide_all(self, epoch, commit):
        """Commit or abort; the core goes on handing out beams of the old epoch for now."""
        for k in range(NODES):
            reply = self.commit[k](epoch, commit)
            self.assertTrue(reply.success, reply.message)

    def finish(self, epoch):
        self.core.epoch = epoch
        self.core.resampling = False
        self.wait_for_training()

    # Resampling

    def check_resampling(self, ancestors, fetched):
        epoch = self.core.epoch + 1
        replies = self.prepare_all(epoch, ancestors)
        before = self.all_maps(epoch)
        self.assertEqual(len(set(before.values())), PARTICLES, "every map is another")
        self.assertEqual([reply.maps_fetched for reply in replies], fetched)
        size = len(before[0])
        self.assertEqual([reply.bytes_fetched for reply in replies], [n * size for n in fetched])
        self.decide_all(epoch, True)
        # As long as the core has not moved on, no map is trained: these are the copies themselves.
        after = self.all_maps(epoch)
        for j, ancestor in enumerate(ancestors):
            self.assertEqual(after[j], before[ancestor], f"map {j} is not that of {ancestor}")
        self.decide_all(epoch, True)
        self.finish(epoch)

    def test_maps_move_between_the_nodes(self):
        self.check_resampling([4, 1, 1, 0, 4], fetched=[1, 1])

    def test_maps_change_places(self):
        self.check_resampling([3, 4, 3, 0, 1], fetched=[2, 2])

    def test_one_map_takes_all(self):
        self.check_resampling([2, 2, 2, 2, 2], fetched=[0, 1])

    def test_abort_keeps_everything(self):
        epoch = self.core.epoch
        # Beams of an epoch that is not decided: nothing is trained, before or after.
        self.core.epoch, self.core.resampling = epoch + 1, True
        steps = None
        while steps != [self.status[k].steps for k in range(NODES)]:
            steps = [self.status[k].steps for k in range(NODES)]
            time.sleep(1.0)  # two status messages
        before = self.all_maps(epoch)
        self.prepare_all(epoch + 1, [4, 4, 4, 0, 0])
        self.assertEqual(self.all_maps(epoch + 1), before)
        self.decide_all(epoch + 1, False)
        self.assertEqual(self.all_maps(epoch), before)
        self.decide_all(epoch + 1, False)
        self.finish(epoch)

    def test_a_peer_that_does_not_stop_fails_the_preparation(self):
        self.core.resampling = True
        before_s = time.monotonic()
        reply = self.prepare[0](self.core.epoch + 1, [3, 1, 2, 3, 4])
        self.assertFalse(reply.success)
        self.assertIn("svgp_node_1/fetch_maps refused", reply.message)
        self.assertLess(time.monotonic() - before_s, TIMEOUT_S)
        self.decide_all(self.core.epoch + 1, False)
        self.finish(self.core.epoch)

    # A node that is never told

    def test_a_missed_commit_is_learned_from_the_core(self):
        epoch = self.core.epoch + 1
        self.prepare_all(epoch, [0, 0, 0, 3, 3])
        reply = self.commit[0](epoch, True)
        self.assertTrue(reply.success, reply.message)
        self.finish(epoch)
        self.assertEqual(self.status[1].epoch, epoch)

    def test_a_missed_abort_is_learned_from_the_core(self):
        self.prepare_all(self.core.epoch + 1, [0, 0, 0, 3, 3])
        before = self.all_maps(self.core.epoch + 1)
        time.sleep(TIMEOUT_S + 1.5)
        self.assertEqual(self.all_maps(self.core.epoch), before, "the core has not decided yet")
        self.finish(self.core.epoch)

    # Requests

    def test_predictions(self):
        xy = np.random.uniform(-10, 10, (3, 64, 2)).astype(np.float32)
        particles = [2, 0, 1]
        reply = self.predict[0](self.core.epoch, particles, 64, pack(xy))
        self.assertTrue(reply.success, reply.message)
        mean = unpack("mean", reply.mean, (3, 64))
        variance = unpack("variance", reply.variance, (3, 64))
        prior_variance = unpack("prior_variance", reply.prior_variance, (3,))
        self.assertTrue((variance > 0).all())
        self.assertTrue((prior_variance > 0).all())
        self.assertTrue((mean < 0).all())

    def test_bad_requests_are_refused_and_the_node_lives_on(self):
        epoch, xy = self.core.epoch, np.zeros((1, 4, 2))
        predict, nan = self.predict[0], np.full((1, 4, 2), np.nan)
        refused = {
            f"epoch is {epoch + 3}": predict(epoch + 3, [0], 4, pack(xy)),
            "particle is 3; expected 0 .. 2": predict(epoch, [3], 4, pack(xy)),
            "positions has 32 bytes; expected 64": predict(epoch, [0, 1], 4, pack(xy)),
            "positions[0, 0, 0] is nan": predict(epoch, [0], 4, pack(nan)),
            "0 points of 1 particles": predict(epoch, [0], 0, b""),
            "particle is 9": self.get_maps[0](epoch, [9]),
            f"epoch is {epoch + 2}; expected {epoch} or": self.get_maps[0](epoch + 2, [0]),
            f"epoch is {epoch + 2}; expected {epoch + 1}": self.prepare[0](epoch + 2, range(5)),
            "ancestors has 4 entries; expected 5": self.prepare[0](epoch + 1, range(4)),
            "ancestors[2] is 5; expected 0 .. 4": self.prepare[0](epoch + 1, [0, 1, 5, 3, 4]),
            "nothing is prepared": self.commit[0](epoch + 1, True),
            f"survey is {self.core.survey + 1:x}; expected": service(
                0, "commit_resampling", srv.CommitResampling
            )(self.core.survey + 1, epoch + 1, True),
        }
        for message, reply in refused.items():
            self.assertFalse(reply.success, message)
            self.assertIn(message, reply.message)
        self.wait_for_training()
        self.assertTrue(predict(epoch, [0], 4, pack(xy)).success)

    # The core

    def test_rubbish_is_refused_and_the_node_lives_on(self):
        rng = np.random.default_rng(2)
        epoch, answered, asked = self.core.epoch, 0, 0
        before_mb = self.status[0].peak_rss_mb
        kinds = {
            "commit_resampling": srv.CommitResampling,
            "get_maps": srv.GetMaps,
            "predict": srv.PredictBeams,
            "prepare_resampling": srv.PrepareResampling,
        }
        calls = [(service(0, name, kind), kind._request_class) for name, kind in kinds.items()]
        for _ in rounds(40):
            for call, request_class in calls:
                request = rubbish_request(request_class, rng, cut_share=0.0)
                if request.epoch == epoch + 1:
                    request.epoch = 1000  # that of a resampling is waited for
                answered += is_answered(call, request)
                asked += 1
            valid = self.predict[0](epoch, [0], 4, pack(np.zeros((1, 4, 2))))
            self.assertTrue(valid.success, valid.message)
        self.assertGreater(answered, asked / 2)
        self.wait_for_training()
        self.assertEqual([self.status[k].epoch for k in range(NODES)], [epoch] * NODES)
        self.check_resampling([4, 1, 1, 0, 4], fetched=[1, 1])
        after_mb = self.status[0].peak_rss_mb
        self.assertLess(after_mb - before_mb, 100.0)
        print(
            f"map node: valid requests among rubbish all answered, {answered} of {asked} absurd "
            f"ones answered, from {before_mb:.0f} to {after_mb:.0f} MB"
        )

    def test_the_core_may_restart(self):
        self.core.service.shutdown()
        time.sleep(1.0)
        self.core.advertise()
        self.wait_for_training()

    def test_for_another_survey_all_maps_are_made_anew(self):
        before = {k: self.status[k] for k in range(NODES)}
        xy = pack(np.zeros((1, 4, 2)))
        self.core.survey, self.core.epoch = before[0].survey + 1, 0
        wait_until(
            lambda: all(self.status[k].survey == self.core.survey for k in range(NODES)), "anew"
        )
        for k in range(NODES):
            self.assertLess(self.status[k].steps, before[k].steps)
        self.wait_for_training()
        self.assertTrue(self.predict[0](0, [0], 4, xy).success)
        old = service(0, "predict", srv.PredictBeams)(before[0].survey, 0, [0], 4, xy)
        self.assertIn(f"survey is {before[0].survey:x}; expected", old.message)

    def test_broken_beams_do_no_harm(self):
        self.core.beams_override = b"123"
        time.sleep(0.5)
        self.core.beams_override = None
        self.wait_for_training()

    def test_an_empty_log_is_asked_gently(self):
        self.core.beams_in_log = 0
        time.sleep(0.3)
        calls = self.core.calls
        time.sleep(1.0)
        # Two nodes, four questions a second each, and one for the edges.
        self.assertLessEqual(self.core.calls - calls, 10)

    def test_an_epoch_that_was_missed_is_adopted(self):
        self.core.epoch += 5
        self.wait_for_training()

    # What is published

    def test_status(self):
        for k in range(NODES):
            status = self.status[k]
            self.assertEqual(status.node, k)
            self.assertEqual(list(status.particles), list(OWN[k]))
            for field in (status.iterations, status.ready, status.objective):
                self.assertEqual(len(field), len(OWN[k]))
            self.assertTrue(np.isfinite(status.objective).all())
            self.assertGreater(status.peak_rss_mb, 10)

    def test_the_best_particles_map_is_published(self):
        status = rospy.Publisher("rbpf_core/status", FilterStatus, queue_size=1, latch=True)
        status.publish(FilterStatus(survey=self.core.survey, best_particle=4))
        # a beam in each cell of 2 m
        everywhere = [(x, y, -20.0) for x in range(101, 141, 2) for y in range(1, 31, 2)]
        beams = rospy.Publisher(names.BATHYMETRY, PointCloud2, queue_size=1, latch=True)
        beams.publish(point_cloud2.create_cloud_xyz32(Header(frame_id="map"), everywhere))
        clouds = {
            name: rospy.wait_for_message(f"map/{name}", PointCloud2, PATIENCE_S)
            for name in ("mean", "variance", "inducing_points")
        }
        ranks = rospy.wait_for_message("map/depth_rank", OccupancyGrid, PATIENCE_S)
        self.assertEqual((ranks.info.width, ranks.info.height, ranks.info.resolution), (20, 15, 2))
        self.assertEqual((min(ranks.data), max(ranks.data)), (0, 100))
        points = {
            name: np.array(list(point_cloud2.read_points(cloud))) for name, cloud in clouds.items()
        }
        for cloud in clouds.values():
            self.assertEqual(cloud.header.frame_id, "map")
        self.assertEqual(points["mean"].shape, (20 * 15, 4))
        self.assertEqual([f.name for f in clouds["mean"].fields], ["x", "y", "z", "rgb"])
        self.assertEqual([f.name for f in clouds["variance"].fields], ["x", "y", "z", "std"])
        self.assertEqual(points["inducing_points"].shape, (16, 3))
        self.assertTrue((points["variance"][:, 3] > 0).all())
        low, high = points["mean"].min(axis=0), points["mean"].max(axis=0)
        np.testing.assert_allclose([low[:2], high[:2]], [[101, 1], [139, 29]], rtol=1e-6)
        status.unregister()
        beams.unregister()

    # The process

    def start_node(self, *arguments):
        # The first is the one that roslaunch would start; the source tree may hold another.
        node = roslib.packages.find_node("rbpf_svgp_slam", "svgp_node.py")[0]
        return subprocess.Popen(
            [node, *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )

    def test_an_interrupt_ends_the_node_quietly_before_roslaunch_loses_patience(self):
        rospy.set_param("/apart/rbpf_svgp_slam", rospy.get_param("rbpf_svgp_slam"))
        node = self.start_node("__ns:=/apart", "__name:=svgp_node_1", "_index:=1")
        rospy.wait_for_service("/apart/svgp_node_1/predict", PATIENCE_S)
        node.send_signal(signal.SIGINT)
        output, _ = node.communicate(timeout=ROSLAUNCH_PATIENCE_S)
        self.assertNotIn("Traceback", output)
        self.assertEqual(node.returncode, 0, output)

    def test_a_bad_start_is_refused_with_a_reason(self):
        rospy.set_param("/wrong/rbpf_svgp_slam", rospy.get_param("rbpf_svgp_slam"))
        rospy.set_param("/wrong/rbpf_svgp_slam/svgp/kernel", "periodic")
        for arguments, message in [
            (["__ns:=/wrong"], "rbpf_svgp_slam/svgp/kernel is 'periodic'; expected one of"),
            (["__name:=svgp_node_2", "_index:=2"], "~index is 2; expected an integer in 0 .. 1"),
            (["__name:=other", "_index:=1"], "name is other; expected svgp_node_1"),
            (["__ns:=/nowhere", "__name:=svgp_node_0", "_index:=0"], "config/default.yaml"),
        ]:
            node = self.start_node(*arguments)
            output, _ = node.communicate(timeout=PATIENCE_S)
            self.assertEqual(node.returncode, 1, output)
            self.assertIn(message, output)
            self.assertNotIn("Traceback", output)


if __name__ == "__main__":
    rospy.init_node("test_resampling")
    rostest.rosrun("rbpf_svgp_slam", "test_resampling", ResamplingTest)
