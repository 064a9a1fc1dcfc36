"""A node's side of an offline replay's turns, with a replay that is two queues."""

import queue

import numpy as np
import pytest
from rospy import rostime

from rbpf_svgp_slam.map_node import turns
from rbpf_svgp_slam.map_node.core_client import Minibatches
from rbpf_svgp_slam.map_node.turns import TurnFeed, WorkClock
from rbpf_svgp_slam.msg import MapStatus
from rbpf_svgp_slam.srv import TakeTurnResponse

SOON_S = 5.0  # for what is expected to happen: reached only by a bug
SHORT_S = 0.05  # for what is expected not to happen
SIZE = 4


class Replay:
    """Grants turns, and answers for minibatches as the core does."""

    def __init__(self):
        self.states, self.rounds = queue.Queue(), queue.Queue()
        self.asked, self.fails = [], 0

    def take_turn(self, status):
        self.states.put(status)
        return self.rounds.get()

    def ask(self, particles):
        if self.fails:
            self.fails -= 1
            raise OSError("the connection is lost")
        self.asked.append(particles)
        return Minibatches(0, 0, False, 0, 100, np.zeros((len(particles), SIZE, 3)))


@pytest.fixture
def replay(monkeypatch):
    rostime.set_rostime_initialized(True)  # for throttled messages, without a node
    replay = Replay()
    monkeypatch.setattr(turns, "MinibatchClient", lambda size, epoch: replay)
    monkeypatch.setattr(turns, "EMPTY_LOG_PAUSE_S", 0.0)
    return replay


def make_feed(replay, particles=lambda: [0, 1], per_round=2):
    class Feed(TurnFeed):
        def _take_turn(self, status):
            return replay.take_turn(status)

    steps = iter(range(100))
    return Feed(particles, SIZE, lambda: 0, per_round, lambda: MapStatus(steps=next(steps)))


def test_a_turn_has_a_minibatch_for_each_map_and_round(replay):
    feed = make_feed(replay)
    assert feed.take(SHORT_S) is None, "the end of a turn that never was"
    replay.rounds.put(3)
    replies = [feed.take(SOON_S) for _ in range(3)]
    assert [len(reply.beams) for reply in replies] == [2, 2, 2]
    assert replay.asked == [[0, 1]] * 3


def test_a_teacher_gets_as_many_minibatches_as_there_are_maps(replay):
    feed = make_feed(replay, particles=lambda: [1], per_round=3)
    feed.take(SHORT_S)
    replay.rounds.put(2)
    for _ in range(6):
        assert feed.take(SOON_S) is not None
    assert feed.take(SHORT_S) is None
    assert len(replay.asked) == 6


def test_the_state_is_told_when_all_is_done_and_nothing_is_asked_for_ahead(replay):
    feed = make_feed(replay)
    feed.take(SHORT_S)
    assert replay.states.get(timeout=SOON_S).steps == 0
    replay.rounds.put(1)
    assert feed.take(SOON_S) is not None
    assert replay.states.empty(), "the node may still work on it"
    assert feed.take(SHORT_S) is None
    assert replay.states.get(timeout=SOON_S).steps == 1
    assert feed.take(SHORT_S) is None, "it is the others' turn"
    assert len(replay.asked) == 1


def test_a_turn_without_rounds_tells_how_long_the_log_is(replay):
    feed = make_feed(replay)
    feed.take(SHORT_S)
    replay.rounds.put(0)
    reply = feed.take(SOON_S)
    assert (len(reply.beams), reply.beams_in_log) == (0, 100)
    assert feed.take(SHORT_S) is None
    assert replay.asked == [[]]


def test_maps_that_want_no_minibatches_get_one_reply_a_turn_whatever_its_rounds(replay):
    feed = make_feed(replay, particles=lambda: [], per_round=0)
    feed.take(SHORT_S)
    for turn in range(2):
        replay.rounds.put(7)
        assert feed.take(SOON_S).beams_in_log == 100
        assert feed.take(SHORT_S) is None
    assert replay.asked == [[]] * 2


def test_minibatches_that_do_not_come_are_asked_for_again(replay):
    feed = make_feed(replay)
    feed.take(SHORT_S)
    replay.rounds.put(2)
    replay.fails = 1
    replies = [feed.take(SOON_S) for _ in range(3)]
    assert [reply is None for reply in replies] == [True, False, False]
    assert feed.take(SHORT_S) is None


def test_a_turn_without_rounds_is_not_over_before_its_reply(replay):
    feed = make_feed(replay)
    feed.take(SHORT_S)
    replay.rounds.put(0)
    replay.fails = 1
    assert feed.take(SOON_S) is None
    assert feed.take(SOON_S).beams_in_log == 100


def test_a_lost_connection_is_made_anew_and_asks_for_the_same_turn(replay, monkeypatch):
    asked, made = [], []

    class Proxy:
        def __init__(self, *_, **__):
            made.append(self)

        def __call__(self, status, turn):
            asked.append((len(made), status.steps, turn))
            if len(asked) in (2, 3):  # a dead connection stays dead
                raise ConnectionResetError("reset by peer")
            return TakeTurnResponse(success=True, turn=turn + 1, rounds=5)

        def close(self):
            pass

    monkeypatch.setattr(turns.rospy, "ServiceProxy", Proxy)
    monkeypatch.setattr(turns.rospy, "wait_for_service", lambda *_, **__: None)
    monkeypatch.setattr(turns, "BACK_OFF_S", (0.0, 0.0))
    steps = iter(range(10))
    feed = TurnFeed(lambda: [0], SIZE, lambda: 0, 1, lambda: MapStatus(steps=next(steps)))
    feed.take(SHORT_S)
    for _ in range(5):
        assert feed.take(SOON_S) is not None
    feed.take(SHORT_S)
    assert feed.take(SOON_S) is not None
    # connection, state, last turn done
    assert asked == [(1, 0, 0), (1, 1, 1), (2, 1, 1), (3, 1, 1)]


def test_the_work_clock_counts_work_alone():
    clock = WorkClock()
    clock.spend(1.0)
    clock.spend(2.5)
    assert clock.now() == 3.5
