"""Where a replayed survey stands: played by rosbag play, or read directly by rbpf_offline."""

from __future__ import annotations

import sys
import time
import xmlrpc.client
from typing import Any, Iterator

import rosgraph
import rospy

from rbpf_svgp_slam.bags.opening import open_bag
from rbpf_svgp_slam.bags.topics import TopicError, topic_in_bag
from rbpf_svgp_slam.msg import FilterStatus
from rbpf_svgp_slam.protocol import names
from rbpf_svgp_slam.protocol.running_nodes import running_at

# After the player's end, for what is still on its way to the core: its counters must have stood
# still for so long.
SETTLED_S = 3.0
# The player's answer is asked for so often; once it fails twice, the player has died.
ALIVE_PERIOD_S = 2.0
PRINT_PERIOD_S = 1.0


class ReplayError(RuntimeError):
    """The replay cannot go on; the message says why."""


class _Bag:
    """What a bag holds of the topics that are wanted, under the bag's own names for them."""

    def __init__(self, path: str, odometry_topic: str, ping_topic: str) -> None:
        self.path = path
        with open_bag(path) as bag:
            self._topics = bag.get_type_and_topic_info().topics
        odometry = topic_in_bag(odometry_topic, self._topics, "odometry (odom_topic)", path)
        pings = topic_in_bag(ping_topic, self._topics, "pings (ping_topic)", path)
        self.odometry, self.pings = (self._topics[t].message_count for t in (odometry, pings))

    def messages(self, topic: str, meaning: str) -> Iterator[tuple[Any, str]]:
        """Messages of a topic and the name of their type; none if the bag has no such topic."""
        try:
            topic = topic_in_bag(topic, self._topics, meaning, self.path)
        except TopicError:
            return
        with open_bag(self.path) as bag:
            for _, message, _ in bag.read_messages(topics=[topic]):
                yield message, message._type

    def lost(self, status: FilterStatus) -> int:
        """Pings of the bag that the core has neither taken in nor refused as malformed."""
        return self.pings - status.pings - status.pings_rejected


class PlayedBag(_Bag):
    """A bag played by play_survey.py, whose end is the survey's end."""

    def __init__(self, path: str, odometry_topic: str, ping_topic: str) -> None:
        super().__init__(path, odometry_topic, ping_topic)
        self._counters: tuple[int, ...] = ()
        self._moved_s = 0.0  # monotonic; when the core's counters were last seen to change
        self._next_look_s = 0.0
        self._seen = False  # the player has answered before
        self._silent_looks = 0

    def share_played(self, status: FilterStatus) -> float:
        """0 .. 1."""
        return min(1.0, status.odometry_messages / self.odometry)

    def is_over(self, status: FilterStatus) -> bool:
        """The player has ended, and the core has taken in what it has played.

        Raises ReplayError if the player has failed or died.
        """
        if not self._player_has_ended():
            return False
        now_s = time.monotonic()
        counters = (
            status.odometry_messages,
            status.pings,
            status.pings_waiting,
            status.pings_dropped,
            status.pings_rejected,
        )
        if counters != self._counters:
            self._counters, self._moved_s = counters, now_s
        return now_s - self._moved_s > SETTLED_S

    def _player_has_ended(self) -> bool:
        status = rospy.get_param(names.PLAYER_STATUS, names.PLAYING)
        if status == names.PLAYING:
            self._check_alive()
            return False
        if status != 0:
            problem = rospy.get_param(names.PLAYER_PROBLEM, "")
            raise ReplayError(f"playing the bag failed: {problem}")
        return True

    def _check_alive(self) -> None:
        if time.monotonic() < self._next_look_s:
            return
        self._next_look_s = time.monotonic() + ALIVE_PERIOD_S
        if is_alive(names.PLAYER):
            self._seen, self._silent_looks = True, 0
        elif self._seen:  # before that it is still starting
            self._silent_looks += 1
        if self._silent_looks >= 2:
            raise ReplayError(f"{names.PLAYER} has died before the end of {self.path}")


class OfflineReplay(_Bag):
    """A bag read by rbpf_offline, which says by parameters when it is through, and how it went."""

    def is_over(self, _: FilterStatus) -> bool:
        """The survey and the final training are. Raises ReplayError if the replay has failed."""
        if not rospy.get_param(names.REPLAY_FINISHED, False):
            return False
        problem = rospy.get_param(names.REPLAY_PROBLEM, "")
        if problem:
            raise ReplayError(problem)
        return True

    def wall_s(self) -> float:
        """That the survey took, final training not included."""
        return float(rospy.get_param(names.REPLAY_WALL_S))


class ProgressLine:
    """One line on the terminal, rewritten once a second, with the time that is left."""

    def __init__(self) -> None:
        self._started: tuple[float, float] | None = None
        self._next_print_s = 0.0

    def show(self, share: float, status: FilterStatus) -> None:
        """share: of the survey that has been played, 0 .. 1."""
        now_s = time.monotonic()
        if not status.odometry_messages or now_s < self._next_print_s:
            return
        self._next_print_s = now_s + PRINT_PERIOD_S
        self._started = self._started or (now_s, share)
        elapsed_s, played = now_s - self._started[0], share - self._started[1]
        left_s = int(elapsed_s * (1.0 - share) / played) if played > 0.0 else None
        eta = f"{left_s // 60:02d}:{left_s % 60:02d}" if left_s is not None else "--:--"
        sys.stdout.write(
            f"\rreplay {100 * share:5.1f} %, ETA {eta} | {status.pings} pings, "
            f"{status.maps_ready}/{status.particles} maps ready, {status.prompts} loop-closure "
            f"prompts, {status.epoch} resamplings, N_eff {status.n_eff:.0f}   "
        )
        sys.stdout.flush()

    def end(self) -> None:
        """Leave the line."""
        if self._started:
            sys.stdout.write("\n")
            sys.stdout.flush()


def is_alive(node: str) -> bool:
    """The master knows the node, and it is there."""
    try:
        return running_at(node) is not None
    except (OSError, rosgraph.MasterException, xmlrpc.client.Error):
        return False
