"""Maps that take in every beam once and have nobody to learn from, live and in turns."""

import threading
import time

import numpy as np
import pytest
from rospy import rostime

from rbpf_svgp_slam.map_node import stream_training
from rbpf_svgp_slam.map_node.core_client import Answer, Minibatches
from rbpf_svgp_slam.map_node.map_store import MapStore
from rbpf_svgp_slam.map_node.stream_training import BLOCK_BEAMS, StreamTraining
from rbpf_svgp_slam.maps import MapGroup
from rbpf_svgp_slam.maps.log_block import POSE, LogBlock

SOON_S = 5.0  # for what is expected to happen: reached only by a bug


class Taker:
    """A map that remembers what it has been given."""

    def __init__(self):
        self.taken, self.iterations, self.skipped_steps, self.outdated = [], 0, 0, False

    @property
    def next_beam(self):
        return len(self.taken)

    def take_in(self, beams):
        self.taken += beams[:, 2].tolist()

    def rebuild(self, beams, beams_in_log, pause):
        self.taken, self.outdated = [0.0] * beams_in_log, False


class Takers(MapGroup):
    """Studies what it is told to, and remembers that."""

    rebuild_beams = 100
    map_class = from_parameters = load = load_saved = None

    def __init__(self):
        self.due, self.lessons = None, []

    def create(self):
        return Taker()

    def study_due(self, beams_in_log):
        return self.due

    def study(self, beams):
        self.lessons.append(beams[:, 2].tolist())
        self.due = None

    @property
    def studied(self):
        return self.due is None


class Core:
    """A log of N beams, whose k-th has z = k; in place of the feed and of the reader."""

    def __init__(self):
        self.N, self.past, self.read_sizes, self.samples = 0, 0, [], []
        self.go_on = threading.Event()
        self.go_on.set()

    def take(self, timeout_s):
        return Minibatches(0, 0, False, self.past, self.N, np.empty((0, 1, 3)))

    def read(self, particles, first, size):
        assert self.go_on.wait(SOON_S)
        self.read_sizes.append(size)
        z = np.arange(first, min(first + size, self.N))
        poses = np.zeros((len(particles), 1), POSE)
        levelled = np.outer(z, [0.0, 0.0, 1.0])
        return Answer(0, self.past, self.N, LogBlock(levelled, np.array([len(z)]), poses))

    def sample(self, particle, size):
        self.samples.append((particle, size))
        return Answer(0, self.past, self.N, np.zeros((size, 3)))


@pytest.fixture
def core(monkeypatch):
    rostime.set_rostime_initialized(True)  # for throttled messages, without a node
    core = Core()
    monkeypatch.setattr(stream_training, "BeamReader", lambda: core)
    monkeypatch.setattr(stream_training, "LogFeed", lambda epoch, period_s: core)
    return core


def make(core, monkeypatch, in_turns):
    """A node of three maps; in turns the feed is the core too."""
    asked = []

    def turns(particles, size, epoch, per_round, end_turn):
        asked.append((particles(), size, per_round))
        return core

    monkeypatch.setattr(stream_training, "TurnFeed", turns)
    group = Takers()
    store = MapStore(0, 3, 1, group)
    node = StreamTraining(store, group, lambda: None, (lambda: None) if in_turns else None)
    # The core takes sizes from 1, and no minibatches are wanted in a round.
    assert asked == ([([], 1, 0)] if in_turns else [])
    return store, group, node


@pytest.mark.parametrize("in_turns", [False, True])
def test_one_reply_is_enough_to_take_in_the_whole_log_once(core, monkeypatch, in_turns):
    store, _, node = make(core, monkeypatch, in_turns)
    for core.N in (5, 3000, 3001):
        node.advance()
        for one in store.maps().values():
            assert one.taken == list(range(core.N))
    assert set(core.read_sizes) == {BLOCK_BEAMS}
    assert core.samples == []


@pytest.mark.parametrize("in_turns", [False, True])
def test_outdated_maps_are_rebuilt_from_a_sample(core, monkeypatch, in_turns):
    store, _, node = make(core, monkeypatch, in_turns)
    if not in_turns:
        monkeypatch.setattr(stream_training, "REBUILD_SHARE", 1.0)  # no pauses
    core.N = 3000
    node.advance()
    store.maps()[1].outdated = True
    deadline_s = time.monotonic() + SOON_S
    while store.outdated() and time.monotonic() < deadline_s:
        node.advance()
        time.sleep(0.001)  # for the sample to be read
    assert store.outdated() == [] and core.samples == [(1, 100)]
    assert store.maps()[1].taken == [0.0] * 3000


def test_a_resampling_does_not_wait_for_beams_that_are_on_their_way(core, monkeypatch):
    store, _, node = make(core, monkeypatch, in_turns=False)
    core.N = 10
    core.go_on.clear()
    trainer = threading.Thread(target=node.advance, daemon=True)
    trainer.start()
    store.prepare(1, [0, 1, 2], lambda epoch, wanted: {}, SOON_S)
    trainer.join(SOON_S)
    assert not trainer.is_alive()
    assert store.maps()[0].taken == []
    core.go_on.set()


@pytest.mark.parametrize("in_turns", [False, True])
def test_what_is_to_be_studied_first_is_studied_before_beams_are_taken_in(
    core, monkeypatch, in_turns
):
    store, group, node = make(core, monkeypatch, in_turns)
    core.N, group.due = 30, (10, 5)
    read = core.read
    monkeypatch.setattr(core, "read", lambda *_: None)  # the core does not answer
    node.advance()
    assert group.lessons == [] and store.maps()[0].taken == []
    monkeypatch.setattr(core, "read", read)
    node.advance()
    assert group.lessons == [[10.0, 11.0, 12.0, 13.0, 14.0]]
    assert store.maps()[2].taken == list(range(30))


def test_maps_that_are_at_different_beams_are_brought_up_to_date(core, monkeypatch):
    store, _, node = make(core, monkeypatch, in_turns=True)
    core.N = 2000
    store.maps()[1].taken = list(range(1500))
    node.advance()
    assert all(one.taken == list(range(2000)) for one in store.maps().values())


def test_a_map_that_takes_in_nothing_does_not_hold_up_the_others(core, monkeypatch):
    store, _, node = make(core, monkeypatch, in_turns=True)
    core.N = 3000
    monkeypatch.setattr(store.maps()[1], "take_in", lambda beams: 1 / 0)
    for _ in range(2):
        node.advance()
    assert [one.next_beam for one in store.maps().values()] == [3000, 0, 3000]
