#!/usr/bin/env python3
"""The real core on a short survey: what it lends to the maps, over the wire."""

import copy
import subprocess
import threading
import time
import unittest

import numpy as np
import roslib.packages
import rospy
import rostest
import tf2_ros
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import Odometry, Path
from rubbish import is_answered, rounds, rubbish_request, rubbish_sender
from sensor_msgs import point_cloud2
from sensor_msgs.msg import Image, PointCloud2, PointField
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from rbpf_svgp_slam import srv
from rbpf_svgp_slam.display.status_display import StatusDisplay
from rbpf_svgp_slam.display.status_rows import status_rows
from rbpf_svgp_slam.display.text_image import text_image
from rbpf_svgp_slam.maps.log_block import POSE, LogBlock
from rbpf_svgp_slam.msg import FilterStatus
from rbpf_svgp_slam.protocol import names
from rbpf_svgp_slam.protocol.payload import unpack, unpack_records

PARTICLES = 3
DURATION_S, BEAMS = 20, 8  # a ping a second
RUBBISH_S, RUBBISH_A_SECOND = 60, 10  # of each topic
PATIENCE_S = 30.0  # for what must happen; reached only by a bug


def service(name, service_class):
    rospy.wait_for_service(f"rbpf_core/{name}", PATIENCE_S)
    return rospy.ServiceProxy(f"rbpf_core/{name}", service_class)


def block_of(reply, particles):
    counts = np.array(reply.beams_of_ping, dtype=int)
    beams = unpack("beams", reply.beams, (counts.sum(), 3))
    poses = unpack_records("poses", reply.poses, POSE, (particles, len(counts)))
    return LogBlock(beams, counts, poses)


def await_listener(topic_publisher):
    deadline_s = time.monotonic() + PATIENCE_S
    while topic_publisher.get_num_connections() == 0 and time.monotonic() < deadline_s:
        time.sleep(0.01)


def publisher(topic, message_class):
    """Latched would keep the last message only: the core must be listening before the first."""
    result = rospy.Publisher(topic, message_class, queue_size=100)
    await_listener(result)
    return result


def odometry(stamp_s):
    message = Odometry(header=Header(stamp=rospy.Time(stamp_s), frame_id="odom"))
    message.child_frame_id = "base_link"
    message.pose.pose.position.z = -10.0
    message.pose.pose.orientation.w = 1.0
    message.twist.twist.linear.x = 2.0
    return message


def ping(stamp_s, frame="mbes"):
    """Every beam of a survey of 15 minutes at a depth of its own, within range."""
    depths_m = 20 + np.arange(BEAMS) / 16 + stamp_s % 900 / 2
    header = Header(stamp=rospy.Time(stamp_s), frame_id=frame)
    beams = [(0.0, float(i), -depth_m) for i, depth_m in enumerate(depths_m)]
    return point_cloud2.create_cloud_xyz32(header, beams)


def truth_beside(offset_m):
    """A path that runs beside dead reckoning, so far to its left."""
    path = Path(header=Header(frame_id="map"))
    for stamp_s in range(1, DURATION_S + 1):
        pose = PoseStamped(header=Header(stamp=rospy.Time(stamp_s), frame_id="map"))
        at = pose.pose.position
        at.x, at.y, at.z = 2.0 * (stamp_s - 1), offset_m, -10.0
        path.poses.append(pose)
    return path


class CoreTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.get_beams = service("get_beams", srv.GetBeams)
        cls.get_minibatches = service("get_minibatches", srv.GetMinibatches)
        cls.get_pings = service("get_pings", srv.GetPings)
        cls.empty = [cls.get_beams([0], 0, 10), cls.get_minibatches([0], 10)]
        cls.sail()

    @classmethod
    def sail(cls):
        mount = TransformStamped(header=Header(frame_id="base_link"), child_frame_id="mbes")
        mount.transform.rotation.w = 1.0
        cls.broadcaster = tf2_ros.StaticTransformBroadcaster()
        cls.broadcaster.sendTransform(mount)
        await_listener(cls.broadcaster.pub_tf)  # the survey is over in a blink
        cls.moves = publisher("odom", Odometry)
        cls.pings = publisher("mbes/pings", PointCloud2)
        for stamp_s in range(1, DURATION_S + 1):
            cls.moves.publish(odometry(stamp_s))
            # a sensor whose mount nobody knows must hold up no other
            cls.pings.publish(ping(stamp_s, frame="nowhere"))
            cls.pings.publish(ping(stamp_s))
        deadline_s = time.monotonic() + PATIENCE_S
        while cls.get_pings(0, 0).pings_total < DURATION_S and time.monotonic() < deadline_s:
            time.sleep(0.05)

    def lent_depths(self):
        """z of the pings that are neither held out nor held back, in the log's order."""
        reply = self.get_pings(0, DURATION_S)
        self.assertEqual(reply.pings_total, DURATION_S)
        stamps_s = np.frombuffer(reply.stamps, "<f8")
        z = unpack("beams", reply.beams, (DURATION_S, BEAMS, 3))[:, :, 2]
        return z[~np.array(reply.held_out) & (stamps_s <= DURATION_S - 5)].ravel()

    def test_maps_that_go_on_where_they_stopped_take_every_beam_in_once(self):
        lent = self.lent_depths()
        blocks, taken = [], 0
        while taken < len(lent):
            reply = self.get_beams(range(PARTICLES), taken, 13)
            self.assertTrue(reply.success, reply.message)
            self.assertEqual((reply.epoch, reply.resampling), (0, False))
            self.assertEqual(reply.beams_in_log, len(lent))
            block = block_of(reply, PARTICLES)
            self.assertEqual(len(block), min(13, len(lent) - taken))
            blocks.append([block.placed(j) for j in range(PARTICLES)])
            taken += len(block)
        logs = np.concatenate(blocks, axis=1)
        for log in logs:
            np.testing.assert_array_equal(log[:, 2], lent)
        self.assertGreater(np.ptp(logs[:, :, 0], axis=0).max(), 0.0, "histories of their own")

    def test_what_has_been_taken_in_is_not_sent_again(self):
        n = len(self.lent_depths())
        for first, left in ((n, 0), (n - 3, 3)):
            reply = self.get_beams([2, 0], first, 100)
            self.assertTrue(reply.success, reply.message)
            self.assertEqual(len(block_of(reply, 2)), left)

    def test_nothing_weighted_or_resampled_leaves_both_estimates_alike(self):
        reply = self.get_pings(0, DURATION_S)
        rows = [
            np.frombuffer(getattr(reply, name), "<f8").reshape(DURATION_S, 6)
            for name in ("estimate", "online", "estimate_covariance", "online_covariance")
        ]
        # histories keep cosines as float32
        np.testing.assert_allclose(rows[1], rows[0], atol=1e-6)
        np.testing.assert_allclose(rows[3], rows[2], atol=1e-6)
        xx, xy, _, yy, _, yaw = rows[3][1:].T
        self.assertTrue(np.all((xx > 0) & (yy > 0) & (yaw > 0) & (xy**2 <= xx * yy)))

    def test_an_empty_log_is_refused_alike(self):
        for reply in self.empty:
            self.assertFalse(reply.success)
            self.assertEqual(reply.message, "no beams in the log yet")
            self.assertEqual(reply.beams_in_log, 0)

    def test_bad_requests_are_refused(self):
        n = len(self.lent_depths())
        refused = {
            f"first is {n + 1}, expected at most {n}": self.get_beams([1], n + 1, 10),
            "particle 3, expected below 3": self.get_beams([3], 0, 10),
            "size is 0, expected": self.get_beams([0], 0, 0),
        }
        for message, reply in refused.items():
            self.assertFalse(reply.success, message)
            self.assertIn(message, reply.message)
            self.assertEqual((len(reply.poses), len(reply.beams)), (0, 0))

    def test_parameters_that_forbid_each_other_are_refused_at_the_start(self):
        rospy.set_param("/wrong/rbpf_svgp_slam", rospy.get_param("rbpf_svgp_slam"))
        core = roslib.packages.find_node("rbpf_svgp_slam", "rbpf_core")[0]
        for name, value, message in [
            ("lc/min_n_eff_share", 0.5, "0.500000, expected a number below resampling/threshold"),
            ("nodes", 4, "4, expected at most one for each of the 3 particles"),
        ]:
            right = rospy.get_param(f"rbpf_svgp_slam/{name}")
            rospy.set_param(f"/wrong/rbpf_svgp_slam/{name}", value)
            start = subprocess.run(
                [core, "__ns:=/wrong"],
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                timeout=PATIENCE_S,
            )
            self.assertNotEqual(start.returncode, 0, start.stdout)
            self.assertIn(f"{name} is {message}", start.stdout)
            rospy.set_param(f"/wrong/rbpf_svgp_slam/{name}", right)

    def test_a_second_core_is_refused_and_the_first_goes_on(self):
        core = roslib.packages.find_node("rbpf_svgp_slam", "rbpf_core")[0]
        second = subprocess.run([core], stderr=subprocess.PIPE, text=True, timeout=PATIENCE_S)
        self.assertNotEqual(second.returncode, 0)
        self.assertIn("/rbpf_core runs already, at http://", second.stderr)
        self.assertTrue(self.get_beams([0], 0, 1).success)

    def test_what_cannot_be_taken_in_is_counted_by_reason(self):
        not_finite, not_float = odometry(DURATION_S + 1), ping(DURATION_S)
        not_finite.twist.twist.linear.x = float("nan")
        not_float.fields[1].datatype = PointField.INT32
        expected = {
            "odometry/duplicate_stamp": "odometry's stamp is 20.000 s, expected later than 20.0",
            "odometry/not_finite": "odometry's linear velocity is (nan, 0, 0), expected finite",
            "odometry/out_of_order": "odometry's stamp is 3.000 s, expected later than 20.0",
            "pings/malformed": "ping's field 'y' is of datatype 5 (int32), expected 7 (float32)",
            "pings/no_stamp": "header.stamp is 0, expected a time",
        }
        for message in (odometry(DURATION_S), not_finite, odometry(3)):
            self.moves.publish(message)
        for message in (not_float, ping(0)):
            self.pings.publish(message)
        status, deadline_s = FilterStatus(), time.monotonic() + PATIENCE_S
        while sum(status.refusal_counts) < len(expected) and time.monotonic() < deadline_s:
            status = rospy.wait_for_message("rbpf_core/status", FilterStatus, PATIENCE_S)
        self.assertEqual(sorted(status.refusal_reasons), sorted(expected))
        self.assertEqual(list(status.refusal_counts), [1] * len(expected))
        for reason, example in zip(status.refusal_reasons, status.refusal_examples):
            self.assertIn(expected[reason], example)
        self.assertEqual((status.pings_rejected, status.pings_dropped), (2, 0))
        self.assertEqual((status.pings, status.pings_waiting), (DURATION_S, DURATION_S))

    def test_the_display_tells_the_time_and_the_errors_of_both_tracks(self):
        truth = rospy.Publisher(names.TRUTH_PATH, Path, queue_size=1, latch=True)
        truth.publish(truth_beside(offset_m=1.0))
        estimate = np.frombuffer(self.get_pings(0, DURATION_S).estimate, "<f8").reshape(-1, 6)
        expected = [[at.x, at.y, at.z] for at in (p.pose.position for p in truth_beside(1.0).poses)]
        ate_m = np.sqrt(np.mean(np.sum((estimate[:, :3] - expected) ** 2, axis=1)))
        threading.Thread(target=StatusDisplay().spin, daemon=True).start()
        deadline_s = time.monotonic() + PATIENCE_S
        shown = wanted = None
        while wanted is None or (shown != wanted and time.monotonic() < deadline_s):
            status = rospy.wait_for_message(names.FILTER_STATUS, FilterStatus, PATIENCE_S)
            wanted = text_image(status_rows(status, DURATION_S - 1.0, ate_m, 1.0)).tobytes()
            shown = rospy.wait_for_message(names.STATUS_IMAGE, Image, PATIENCE_S).data
        self.assertTrue(shown == wanted, "another picture than that of the errors")

    def test_what_cannot_be_done_when_asked_says_why(self):
        prompt = service("prompt", Trigger)()
        self.assertFalse(prompt.success)
        self.assertEqual(prompt.message, "not weighed: waiting for map nodes: 0 of 1 have reported")
        # one straight line
        smooth = service("smooth", Trigger)()
        self.assertTrue(smooth.success, smooth.message)
        self.assertIn("0 new closures, 0 of them accepted", smooth.message)
        self.assertIn("the past stays where it is", smooth.message)

    def test_while_mapping_is_paused_pings_are_refused_and_the_pose_goes_on(self):
        """After all before it by its name, for the survey goes on in it."""
        pause, resume = (service(f"{what}_mapping", Trigger) for what in ("pause", "resume"))
        self.assertEqual(pause().message, "pings are not taken in from now on")
        self.assertEqual(pause().message, "pings are not taken in, as before")
        self.pings.publish(ping(DURATION_S + 1))
        self.moves.publish(odometry(DURATION_S + 1))
        status = self.await_status(
            lambda now: now.header.stamp.to_sec() > DURATION_S
            and "pings/mapping_paused" in now.refusal_reasons
        )
        self.assertTrue(status.mapping_paused)
        self.assertEqual(status.pings, DURATION_S)
        self.assertTrue(resume().success)
        self.pings.publish(ping(DURATION_S + 2))
        self.moves.publish(odometry(DURATION_S + 2))
        status = self.await_status(lambda now: now.pings > DURATION_S)
        self.assertFalse(status.mapping_paused)

    def test_with_a_reset_the_survey_starts_over(self):
        """After even that, by its name."""
        before = self.await_status(lambda now: now.survey != 0)
        self.the_survey_ends_for_who_knows_its_number(before)
        reset = service("reset", Trigger)
        self.assertEqual(reset().message, "the survey starts over")
        before = self.await_status(lambda now: now.survey != before.survey)
        self.assertTrue(service("pause_mapping", Trigger)().success)
        self.assertEqual(reset().message, "the survey starts over; pings are taken in again")
        resume = service("resume_mapping", Trigger)()
        self.assertEqual(resume.message, "pings are taken in, as before")
        for name in ("smooth", "prompt"):
            nothing = service(name, Trigger)()
            self.assertFalse(nothing.success)
            self.assertIn("no ping has been taken in", nothing.message)
        # a subscriber of rospy may miss a topic for good that ends and begins twice at once
        before = self.await_status(lambda now: now.survey != before.survey)
        self.assertEqual(reset().message, "the survey starts over")
        status = self.await_status(lambda now: now.survey != before.survey)
        self.assertEqual((status.pings, status.odometry_messages), (0, 0))
        self.assertEqual(list(status.refusal_reasons), [])
        self.assertEqual(self.get_pings(0, 1).pings_total, 0)
        # RViz's clock, which is not that of a bag: what it is told must not stop the survey
        now = rospy.Time.now()
        start = PoseWithCovarianceStamped(header=Header(stamp=now, frame_id="map"))
        start.pose.pose.position.x, start.pose.pose.position.y = 120.0, 10.0
        start.pose.pose.orientation.z = start.pose.pose.orientation.w = np.sqrt(0.5)
        for i in (0, 7, 35):
            start.pose.covariance[i] = 1e-6
        # what is refused is no start
        elsewhere, nowhere, twice = (copy.deepcopy(start) for _ in range(3))
        elsewhere.header.frame_id = "odom"
        nowhere.pose.pose.position.x = float("nan")
        twice.pose.pose.orientation.w = 2.0
        given = publisher("initialpose", PoseWithCovarianceStamped)
        for pose in (elsewhere, nowhere, twice, start):
            given.publish(pose)
        expected = {
            "fixes/malformed": "orientation has the norm 2.121320, expected 1",
            "fixes/not_finite": "not finite",
            "fixes/wrong_frame": "'odom', expected 'map'",
        }
        status = self.await_status(lambda now: len(now.refusal_reasons) == len(expected))
        for reason, example in zip(status.refusal_reasons, status.refusal_examples):
            self.assertIn(expected[reason], example)
        for topic in (self.moves, self.pings, self.broadcaster.pub_tf):
            await_listener(topic)
        for stamp_s in (1, 2):
            self.moves.publish(odometry(stamp_s))
            self.pings.publish(ping(stamp_s))
        self.await_status(lambda now: now.pings == 2)
        poses = np.frombuffer(self.get_pings(0, 2).estimate, "<f8").reshape(2, 6)
        # 2 m/s to where it points; the odometry's noise in a second is a few centimetres
        np.testing.assert_allclose(
            poses[:, [0, 1, 5]], [[120, 10, 1.57], [120, 12, 1.57]], atol=0.5
        )
        self.fixes_are_taken_where_they_agree(start)

    def the_survey_ends_for_who_knows_its_number(self, before):
        finish, resume = service("finish", srv.Finish), service("resume_mapping", Trigger)
        by_mistake = finish()
        self.assertFalse(by_mistake.success)
        self.assertIn(f"survey is 0, expected {before.survey}", by_mistake.message)
        after_s = before.header.stamp.to_sec() + 1
        self.moves.publish(odometry(after_s))
        self.pings.publish(ping(after_s))
        status = self.await_status(lambda now: now.pings > before.pings)
        ended = finish(before.survey)
        self.assertTrue(ended.success, ended.message)
        self.assertIn(f"{status.pings} pings", ended.message)
        for ask in (resume, service("pause_mapping", Trigger)):
            answer = ask()
            self.assertFalse(answer.success)
            self.assertIn("the survey is over: pings are not taken in", answer.message)
        self.pings.publish(ping(after_s - 0.5))  # its odometry is there
        status = self.await_status(lambda now: "pings/survey_over" in now.refusal_reasons)
        self.assertEqual(status.pings, before.pings + 1)

    def fixes_are_taken_where_they_agree(self, like):
        fixes = publisher("fixes", PoseWithCovarianceStamped)
        fix = PoseWithCovarianceStamped(pose=like.pose)
        fix.header.stamp, fix.header.frame_id = rospy.Time(2), "map"
        fix.pose.pose.position.y = 12.5
        fix.pose.covariance = np.diag([1.0, 4.0, 1.0, 1.0, 1.0, 1.0]).ravel().tolist()
        fixes.publish(fix)
        fix.pose.pose.position.x = 180.0
        fixes.publish(fix)
        status = self.await_status(lambda now: now.fixes and now.fixes_refused > 1)
        refused = dict(zip(status.refusal_reasons, status.refusal_examples))
        self.assertIn("lies 60.0 m from the estimate", refused["fixes/contradicts"])
        (taken,) = service("get_fixes", srv.GetFixes)().fixes
        self.assertEqual((taken.stamp, taken.position), (2.0, (120.0, 12.5)))
        self.assertEqual(taken.covariance, (1.0, 0.0, 4.0))
        self.assertTrue(np.isnan([taken.yaw, taken.yaw_variance]).all(), "a fix has no heading")
        # 2 m/s for a second from the pose that was given, without the particles' noise
        np.testing.assert_allclose(taken.dead_reckoning, (120.0, 12.0, np.pi / 2), atol=1e-6)

    def test_without_pause_strangers_send_rubbish(self):
        """After even the reset, by its name: valid pings in between are all taken in."""
        rng = np.random.default_rng(1)
        rubbish = {
            topic: rubbish_sender(message, lambda kind, topic=topic: publisher(topic, kind), rng)
            for topic, message in (
                ("odom", odometry(1)),
                ("mbes/pings", ping(1)),
                ("fixes", PoseWithCovarianceStamped(header=Header(stamp=rospy.Time(1)))),
                ("initialpose", PoseWithCovarianceStamped(header=Header(stamp=rospy.Time(1)))),
            )
        }
        calls = {
            name: (service(name, kind), kind._request_class)
            for name, kind in (
                ("get_beams", srv.GetBeams),
                ("get_closures", srv.GetClosures),
                ("get_fixes", srv.GetFixes),
                ("get_minibatches", srv.GetMinibatches),
                ("get_pings", srv.GetPings),
            )
        }
        first = rospy.wait_for_message("rbpf_core/status", FilterStatus, PATIENCE_S)
        begin_s = int(first.header.stamp.to_sec()) + 1
        answered = 0
        for stamp_s in map(begin_s.__add__, rounds(RUBBISH_S)):
            self.moves.publish(odometry(stamp_s))
            self.pings.publish(ping(stamp_s))
            for send in rubbish.values():
                for _ in range(RUBBISH_A_SECOND):
                    send(stamp_s + 0.5)
            for call, request_class in calls.values():
                answered += is_answered(call, rubbish_request(request_class, rng))
            time.sleep(0.02)  # the queue is as long as the messages of a quarter of it
            if stamp_s % RUBBISH_S == 0:
                self.await_status(lambda now: now.header.stamp.to_sec() >= stamp_s)
        end_s = stamp_s + 1
        self.moves.publish(odometry(end_s))
        # those of sensors that nobody knows wait for their mounts
        status = self.await_status(lambda now: now.header.stamp.to_sec() >= end_s)
        self.assertEqual(set(map(float, range(begin_s, end_s))) - self.stamps_taken(), set())
        for kind in ("odometry/malformed", "pings/malformed", "fixes/malformed"):
            self.assertIn(kind, status.refusal_reasons)
        self.assertGreater(answered, end_s - begin_s)
        # what is taken in stays: of all messages some 110 bytes each have been seen
        sent = (end_s - begin_s) * (2 + RUBBISH_A_SECOND * len(rubbish))
        self.assertLess(status.peak_rss_mb - first.peak_rss_mb, 100.0 + sent / 4000)
        estimate = np.frombuffer(self.get_pings(0, 1000).estimate, "<f8")
        self.assertTrue(np.isfinite(estimate).all())
        print(
            f"core: {end_s - begin_s} valid pings among rubbish all taken in, {answered} of "
            f"{len(calls) * (end_s - begin_s)} absurd requests answered, from "
            f"{first.peak_rss_mb:.0f} to {status.peak_rss_mb:.0f} MB"
        )

    def stamps_taken(self):
        stamps_s = []
        while more := np.frombuffer(self.get_pings(len(stamps_s), 10_000).stamps, "<f8").tolist():
            stamps_s += more
        return set(stamps_s)

    def await_status(self, is_wanted):
        deadline_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline_s:
            status = rospy.wait_for_message("rbpf_core/status", FilterStatus, PATIENCE_S)
            if is_wanted(status):
                return status
        raise AssertionError(f"waited in vain; the last status: {status}")

    def test_minibatches_have_common_random_numbers(self):
        reply = self.get_minibatches(range(PARTICLES), 50)
        self.assertTrue(reply.success, reply.message)
        beams = unpack("beams", reply.beams, (PARTICLES, 50, 3))
        np.testing.assert_array_equal(beams[0, :, 2], beams[1, :, 2])
        np.testing.assert_array_equal(beams[0, :, 2], beams[2, :, 2])
        self.assertGreater(np.ptp(beams[:, :, 0], axis=0).max(), 0.0, "histories of their own")


if __name__ == "__main__":
    rospy.init_node("test_core")
    rostest.rosrun("rbpf_svgp_slam", "test_core", CoreTest)
