"""The feed of minibatches, with a core whose answers can be held back."""

import threading
import time

import numpy as np
import pytest
from rospy import rostime

from rbpf_svgp_slam.map_node import core_client
from rbpf_svgp_slam.map_node.background import AtOnce, Background
from rbpf_svgp_slam.map_node.core_client import LogFeed, Minibatches, MinibatchFeed

SOON_S = 5.0  # for what is expected to happen: reached only by a bug
SIZE = 10
PARTICLES = [3, 4]


class Core:
    """Numbers the minibatches that it gives out; its answers can be late, or refused."""

    def __init__(self):
        self.asked, self.given, self.delay_s, self.empty = [], 0, 0.0, False

    def ask(self, particles):
        self.asked.append(particles)
        time.sleep(self.delay_s)
        if self.empty:
            return None
        beams = np.empty((len(particles), SIZE, 3), dtype=np.float32)
        beams[:] = self.given + np.arange(len(particles))[:, None, None]
        self.given += len(particles)
        return Minibatches(0, 0, False, 0, 1000, beams)

    def rounds(self):
        """Per question so far."""
        return [len(particles) // len(PARTICLES) for particles in self.asked]


@pytest.fixture
def core(monkeypatch):
    rostime.set_rostime_initialized(True)  # for throttled messages, without a node
    core = Core()
    monkeypatch.setattr(core_client, "MinibatchClient", lambda size, epoch: core)
    monkeypatch.setattr(core_client, "EMPTY_LOG_PAUSE_S", 0.01)
    return core


@pytest.fixture
def feed(core):
    feed = MinibatchFeed(lambda: PARTICLES, SIZE, lambda: 0)
    yield feed
    feed.stop()


def wait_until(condition):
    deadline_s = time.monotonic() + SOON_S
    while not condition():
        assert time.monotonic() < deadline_s
        time.sleep(0.001)


def first_beams(rounds):
    return [beams[0, 0] for one in rounds for beams in one.beams]


def test_one_round_at_once_while_it_is_there_in_time(core, feed):
    for k in range(5):
        wait_until(lambda: len(core.asked) == k + 1)
        time.sleep(0.01)  # for the reply to be handed over
        feed.take(SOON_S)
    assert core.rounds()[:5] == [1] * 5
    assert core.asked[0] == PARTICLES


def test_more_rounds_at_once_the_longer_training_has_to_wait(core, feed):
    core.delay_s = 0.02
    rounds = [feed.take(SOON_S) for _ in range(40)]
    # every minibatch once, in the order of the questions; two to a round
    assert first_beams(rounds) == list(range(80))
    asked = core.rounds()
    assert asked == sorted(asked)
    assert set(asked) >= {1, 2, 4, 8}
    assert all(particles == PARTICLES * n for particles, n in zip(core.asked, asked))


def test_replies_stay_within_their_limit(core, feed, monkeypatch):
    round_bytes = len(PARTICLES) * SIZE * 3 * 4
    monkeypatch.setattr(core_client, "LARGEST_REPLY_BYTES", 3 * round_bytes)
    core.delay_s = 0.005
    for _ in range(30):
        feed.take(SOON_S)
    assert max(core.rounds()) == 2


def test_waiting_for_a_first_reply_is_no_reason_for_more_rounds(core, feed):
    core.delay_s = 0.02
    for _ in range(3):
        feed.refresh()
        feed.take(SOON_S)
    core.empty = True
    feed.refresh()
    assert feed.take(0.05) is None
    core.empty = False
    feed.take(SOON_S)
    assert set(core.rounds()) == {1}


def test_a_refreshed_feed_hands_out_nothing_that_was_asked_for_before(core, feed):
    core.delay_s = 0.01
    for _ in range(20):
        feed.take(SOON_S)
    core.delay_s = 0.0
    wait_until(lambda: feed._ready)
    given = core.given
    feed.refresh()
    assert first_beams([feed.take(SOON_S)])[0] == given


# Where nobody wants minibatches


def test_the_logs_length_is_asked_for_without_minibatches_and_with_rests(core):
    feed, start_s = LogFeed(lambda: 0, 0.05), time.monotonic()
    replies = []
    while len(replies) < 4:
        reply = feed.take(0.01)
        replies += [] if reply is None else [reply]
    # Three rests between four questions.
    assert time.monotonic() - start_s >= 0.15
    assert core.asked == [[]] * 4
    assert [(reply.beams_in_log, len(reply.beams)) for reply in replies] == [(1000, 0)] * 4


def test_a_refreshed_log_feed_asks_at_once_and_forgets_what_was_asked_before(core):
    feed = LogFeed(lambda: 0, 60.0)
    core.delay_s = 0.05
    assert feed.take(0.0) is None, "the answer is on its way"
    feed.refresh()
    assert feed.take(SOON_S) is not None
    assert len(core.asked) == 2, "the first answer was not used"
    assert feed.take(0.0) is None, "resting"
    feed.refresh()
    assert feed.take(SOON_S) is not None


def test_a_core_without_beams_or_an_answer_is_asked_again(core, monkeypatch):
    feed = LogFeed(lambda: 0, 0.0)
    core.empty = True
    assert feed.take(SOON_S) is None
    core.empty = False
    ask = core.ask
    monkeypatch.setattr(core, "ask", lambda particles: 1 / 0)
    assert feed.take(SOON_S) is None
    monkeypatch.setattr(core, "ask", ask)
    assert feed.take(SOON_S).beams_in_log == 1000


@pytest.mark.parametrize("make", [lambda: Background("test"), AtOnce])
def test_results_and_exceptions_come_to_the_one_who_asked(make):
    calls = make()
    assert calls.submit(max, 3, 4).result(SOON_S) == 4
    with pytest.raises(ZeroDivisionError):
        calls.submit(lambda: 1 / 0).result(SOON_S)
    assert calls.submit(max, 3, 5).result(SOON_S) == 5


def test_calls_in_the_background_are_made_one_after_the_other():
    background, go_on, order = Background("test"), threading.Event(), []
    futures = [background.submit(go_on.wait, SOON_S), background.submit(order.append, 2)]
    assert not futures[1].done()
    order.append(1)
    go_on.set()
    futures[1].result(SOON_S)
    assert order == [1, 2]
