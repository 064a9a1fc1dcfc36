#!/usr/bin/env python3
"""Real map nodes with an engine that only the test tree has, and a core played by this test."""

import time
import unittest
from functools import partial

import numpy as np
import rospy
import rostest
from cell_means import CellMeans
from node_services import PATIENCE_S, at_once, service, wait_until
from sensor_msgs import point_cloud2
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from rbpf_svgp_slam import srv
from rbpf_svgp_slam.maps.log_block import POSE, LogBlock
from rbpf_svgp_slam.msg import FilterStatus, MapStatus
from rbpf_svgp_slam.protocol import names
from rbpf_svgp_slam.protocol.payload import pack, split, unpack

PARTICLES, NODES = 5, 2
OWN = [range(0, 3), range(3, 5)]
BEAMS = 4000  # of the log in the end: several blocks
PRIOR_M2, NOISE_M2 = 5.0**2, 0.2**2  # cell_means.test


class FakeCore:
    """A log that grows, of a seabed that each particle sees turned by another right angle."""

    def __init__(self):
        rng = np.random.default_rng(1)
        xy = rng.uniform(-14, 14, (BEAMS, 2))
        z = np.sin(xy[:, 0] / 8) - 20.0
        self.log = np.column_stack([xy, z]).astype(np.float32)
        self.N, self.epoch, self.resampling = 0, 0, False
        self.past = 0  # each correction turns every history by a right angle
        self.minibatches_asked, self.questions = 0, 0
        self.sent = np.zeros(PARTICLES, dtype=int)  # beams that each particle has been sent
        self.services = [
            rospy.Service(names.GET_MINIBATCHES, srv.GetMinibatches, self.get_minibatches),
            rospy.Service(names.GET_BEAMS, srv.GetBeams, self.get_beams),
        ]

    def placed(self, particle, first, count):
        return self.block([particle], first, count).placed(0)

    def block(self, particles, first, count):
        poses = np.zeros((len(particles), 1), POSE)
        turns = (np.array(particles)[:, None] + self.past) % 4
        poses["cos"], poses["sin"] = np.choose(turns, [1, 0, -1, 0]), np.choose(
            turns, [0, 1, 0, -1]
        )
        return LogBlock(self.log[first : first + count], np.array([count]), poses)

    def get_minibatches(self, request):
        self.questions += 1
        self.minibatches_asked += len(request.particles)
        if self.N == 0:
            return srv.GetMinibatchesResponse(success=False, message="no beams in the log yet")
        return srv.GetMinibatchesResponse(
            success=True,
            epoch=self.epoch,
            resampling=self.resampling,
            past=self.past,
            beams_in_log=self.N,
        )

    def get_beams(self, request):
        first, count = request.first, min(request.size, self.N - request.first)
        self.sent[list(request.particles)] += count
        block = self.block(request.particles, first, count)
        return srv.GetBeamsResponse(
            success=True,
            epoch=self.epoch,
            resampling=self.resampling,
            past=self.past,
            beams_in_log=self.N,
            beams=pack(block.levelled),
            beams_of_ping=block.beams_of_ping,
            poses=block.poses.tobytes(),
        )


class CellMeansTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.core = FakeCore()
        # of survey 0, as in an offline replay
        cls.predict = [partial(service(k, "predict", srv.PredictBeams), 0) for k in range(NODES)]
        cls.prepare = [
            partial(service(k, "prepare_resampling", srv.PrepareResampling), 0)
            for k in range(NODES)
        ]
        cls.commit = [
            partial(service(k, "commit_resampling", srv.CommitResampling), 0) for k in range(NODES)
        ]
        cls.get_maps = [service(k, "get_maps", srv.GetMaps) for k in range(NODES)]

    def maps_as_bytes(self):
        """Of every particle, as they are now."""
        maps = {}
        for k in range(NODES):
            reply = self.get_maps[k](srv.GetMapsRequest.ANY_EPOCH, list(OWN[k]))
            self.assertTrue(reply.success, reply.message)
            self.assertEqual(reply.engine, "cell_means")
            maps.update(zip(OWN[k], split("maps", reply.maps, reply.sizes)))
        return maps

    def maps(self):
        return {j: CellMeans.load_saved(data) for j, data in self.maps_as_bytes().items()}

    def grow(self, beams):
        """The log grows to so many beams, and every map takes them in."""
        self.core.N = beams
        wait_until(
            lambda: all(one.next_beam == beams for one in self.maps().values()),
            f"{beams} beams in every map",
        )

    # In one test, since a log does not shrink.

    def test_an_engine_of_the_test_tree_serves_a_filter(self):
        self.questions_are_gentle()
        self.grow(2500)
        self.every_beam_was_taken_in_once()
        self.predictions_are_of_each_particles_own_map()
        self.maps_follow_their_particles_to_the_other_node()
        self.maps_follow_corrected_histories()
        self.the_state_is_told()
        self.a_map_is_published()

    def questions_are_gentle(self):
        time.sleep(0.5)
        before = self.core.questions
        time.sleep(2.0)
        # Two nodes, a question in half a second each, and one for the edges.
        self.assertLessEqual(self.core.questions - before, 10)
        self.assertGreater(self.core.questions, before)

    def every_beam_was_taken_in_once(self):
        self.assertEqual(self.core.sent.tolist(), [2500] * PARTICLES)
        for j, one in self.maps().items():
            self.assertEqual(one.count.sum(), 2500)
            self.assertAlmostEqual(one.sum.sum(), self.core.placed(j, 0, 2500)[:, 2].sum(), 0)
        self.assertEqual(self.core.minibatches_asked, 0, "nobody learns from minibatches")

    def predictions_are_of_each_particles_own_map(self):
        xy = np.random.default_rng(2).uniform(-14, 14, (2, 64, 2)).astype(np.float32)
        xy[:, 0] = 1000.0, 1000.0  # off the grid
        reply = self.predict[0](self.core.epoch, [2, 0], 64, pack(xy))
        self.assertTrue(reply.success, reply.message)
        mean = unpack("mean", reply.mean, (2, 64))
        variance = unpack("variance", reply.variance, (2, 64))
        truth = np.sin(xy[:, :, 0] * np.array([[-1], [1]]) / 8) - 20.0
        # In a cell of 2 m the seabed rises by 0.25 m at most.
        np.testing.assert_allclose(mean[:, 1:], truth[:, 1:], atol=0.3)
        self.assertTrue((variance[:, 1:] < NOISE_M2).all())
        np.testing.assert_allclose(variance[:, 0], PRIOR_M2, rtol=1e-6)
        prior = unpack("prior_variance", reply.prior_variance, (2,))
        np.testing.assert_allclose(prior, PRIOR_M2, rtol=1e-6)

    def maps_follow_their_particles_to_the_other_node(self):
        epoch, ancestors = self.core.epoch + 1, [4, 1, 1, 0, 4]
        before = self.maps_as_bytes()
        self.core.resampling = True
        prepare = [lambda node=node: node(epoch, ancestors) for node in self.prepare]
        for reply in at_once(prepare):
            self.assertTrue(reply.success, reply.message)
            self.assertEqual(reply.maps_fetched, 1)
        for node in self.commit:
            self.assertTrue(node(epoch, True).success)
        after = self.maps_as_bytes()
        self.assertEqual(after, {j: before[a] for j, a in enumerate(ancestors)})
        self.core.epoch, self.core.resampling = epoch, False
        self.grow(BEAMS)
        for j, one in self.maps().items():
            # The ancestor's beams so far, and from there on the particle's own.
            expected = CellMeans.load_saved(before[ancestors[j]])
            expected.take_in(self.core.placed(j, 2500, BEAMS - 2500))
            np.testing.assert_array_equal(one.count, expected.count)
            np.testing.assert_allclose(one.sum, expected.sum, rtol=1e-9)  # summed in blocks

    def maps_follow_corrected_histories(self):
        before = self.maps()
        self.core.past = 1
        wait_until(
            lambda: all(status.past == 1 for status in self.statuses()), "maps of the new past"
        )
        for j, one in self.maps().items():
            expected = before[j].copy()
            expected.count, expected.sum = np.zeros((2, *expected.count.shape))
            expected.take_in(self.core.placed(j, 0, BEAMS))
            np.testing.assert_array_equal(one.count, expected.count)
            np.testing.assert_allclose(one.sum, expected.sum, rtol=1e-9)  # summed in blocks
            self.assertEqual(one.next_beam, BEAMS)
            self.assertGreater(one.iterations, before[j].iterations)

    def statuses(self):
        return [
            rospy.wait_for_message(f"svgp_node_{k}/status", MapStatus, PATIENCE_S)
            for k in range(NODES)
        ]

    def the_state_is_told(self):
        for k, status in enumerate(self.statuses()):
            self.assertEqual(list(status.particles), list(OWN[k]))
            self.assertTrue(all(status.ready))
            self.assertTrue(np.isfinite(status.objective).all())
            self.assertEqual((status.epoch, status.skipped_steps), (self.core.epoch, 0))
            self.assertEqual(status.past, self.core.past)

    def a_map_is_published(self):
        status = rospy.Publisher(names.FILTER_STATUS, FilterStatus, queue_size=1, latch=True)
        status.publish(FilterStatus(best_particle=4))
        beams = rospy.Publisher(names.BATHYMETRY, PointCloud2, queue_size=1, latch=True)
        beams.publish(
            point_cloud2.create_cloud_xyz32(Header(frame_id="map"), [(109.0, 0.5, -20.0)])
        )
        clouds = [
            rospy.wait_for_message(name, PointCloud2, PATIENCE_S)
            for name in (names.MAP_SUPPORT_POINTS, names.MAP_VARIANCE, names.MAP_MEAN)
        ]
        cells, grid, seen = [list(point_cloud2.read_points(cloud)) for cloud in clouds]
        # The cells of 2 m with beams, 10 to 20 each, and the grid that the map is published on.
        self.assertEqual([len(cells), len(grid)], [14 * 15, 20 * 15])
        # Of that only the cell with a beam, and those beside it.
        near = [(107, 1), (107, 3), (109, 1), (109, 3), (111, 1), (111, 3)]
        self.assertEqual(sorted((x, y) for x, y, *_ in seen), near)


if __name__ == "__main__":
    rospy.init_node("test_cell_means")
    rostest.rosrun("rbpf_svgp_slam", "test_cell_means", CellMeansTest)
