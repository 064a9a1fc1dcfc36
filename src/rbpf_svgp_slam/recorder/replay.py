"""Where a replayed survey stands: played by rosbag play, or read directly by rbpf_offline."""

from __future__ import annotations

import sys
import time
from typing import Any, Iterator

import rosbag
import rospy

from rbpf_svgp_slam.msg import FilterStatus
from rbpf_svgp_slam.protocol import names

STILL_S = 10.0  # rosbag play is taken to be over when nothing has moved for so long
PRINT_PERIOD_S = 1.0


class _Bag:
    """The number of pings of a bag."""

    def __init__(self, path: str, odometry_topic: str, ping_topic: str) -> None:
        self.path = path
        with rosbag.Bag(path) as bag:
            odometry, self.pings = map(bag.get_message_count, (odometry_topic, ping_topic))
        if not odometry or not self.pings:
            raise RuntimeError(
                f"{path} holds {odometry} messages on {odometry_topic} and {self.pings} on "
                f"{ping_topic}; expected both (launch arguments odom_topic, ping_topic)"
            )

    def messages(self, topic: str) -> Iterator[Any]:
        """What the bag holds of a topic."""
        with rosbag.Bag(self.path) as bag:
            for _, message, _ in bag.read_messages(topics=[topic]):
                yield message

    def lost(self, status: FilterStatus) -> int:
        """Pings of the bag that the core has neither taken in nor refused as malformed."""
        return self.pings - status.pings - status.pings_rejected


class PlayedBag(_Bag):
    """A bag played by rosbag play."""

    def __init__(self, path: str, odometry_topic: str, ping_topic: str) -> None:
        super().__init__(path, odometry_topic, ping_topic)
        stamps_s = [message.header.stamp.to_sec() for message in self.messages(odometry_topic)]
        self.begin_s, self.end_s = min(stamps_s), max(stamps_s)
        self._last = (0.0, 0)
        self._moved_s = time.monotonic()

    def share_played(self, status: FilterStatus) -> float:
        """0 .. 1."""
        played_s = status.header.stamp.to_sec() - self.begin_s
        return min(1.0, max(0.0, played_s / max(self.end_s - self.begin_s, 1e-3)))

    def is_over(self, status: FilterStatus) -> bool:
        """The last odometry is in and with it all pings, or nothing has moved for a while."""
        if status.header.stamp.to_sec() >= self.end_s and not self.lost(status):
            return True
        now = (status.header.stamp.to_sec(), status.pings)
        if now != self._last:
            self._last, self._moved_s = now, time.monotonic()
        started = status.odometry_messages > 0
        return started and time.monotonic() - self._moved_s > STILL_S


class OfflineReplay(_Bag):
    """A bag read by rbpf_offline, which says by parameters when it is through, and how it went."""

    def is_over(self, _: FilterStatus) -> bool:
        """The survey and the final training are."""
        return rospy.get_param(names.REPLAY_FINISHED, False)

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
