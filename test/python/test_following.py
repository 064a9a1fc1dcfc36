"""Maps that follow corrections of the histories that their beams were placed by."""

import numpy as np
import pytest
from number_maps import BEAMS, TIMEOUT_S, make_stores, prepare_all
from rospy import rostime

from rbpf_svgp_slam.gmrf.gmrf_config import GmrfConfig
from rbpf_svgp_slam.gmrf.gmrf_group import GmrfGroup
from rbpf_svgp_slam.map_node import stream_training
from rbpf_svgp_slam.map_node.background import AtOnce
from rbpf_svgp_slam.map_node.core_client import Answer, Minibatches
from rbpf_svgp_slam.map_node.map_store import MapStore
from rbpf_svgp_slam.map_node.refolding import Refolding
from rbpf_svgp_slam.map_node.stream_training import BLOCK_BEAMS, StreamTraining
from rbpf_svgp_slam.maps.log_block import POSE, LogBlock
from rbpf_svgp_slam.svgp.config import SvgpConfig
from rbpf_svgp_slam.svgp.group import SvgpGroup

PARTICLES, PINGS, BEAMS_OF_PING = 5, 400, 16
N = PINGS * BEAMS_OF_PING
PLACES = np.random.default_rng(5).uniform([5.0, 12.0], [45.0, 28.0], (40, 2)).astype(np.float32)


def depth(x, y):
    return -40.0 + 0.5 * np.sin(x / 6.0) + 0.3 * np.cos(y / 4.0)


def histories(seed=0):
    """Poses [J, K] of particles that have been resampled twice: a tree.

    All are the same up to ping 150, and two of them up to ping 300.
    """
    rng = np.random.default_rng(seed)
    drift = np.zeros((PARTICLES, PINGS, 3))
    for ping in range(1, PINGS):
        drift[:, ping] = drift[:, ping - 1] + rng.normal(0.0, 0.02, (PARTICLES, 3))
        if ping == 150:
            drift[:, :ping] = drift[2, :ping]
        if ping == 300:
            drift[4, :ping] = drift[1, :ping]
    poses = np.zeros((PARTICLES, PINGS), POSE)
    poses["x"] = np.linspace(0.0, 50.0, PINGS) + drift[:, :, 0]
    poses["y"] = 20.0 + drift[:, :, 1]
    poses["cos"], poses["sin"] = np.cos(0.1 * drift[:, :, 2]), np.sin(0.1 * drift[:, :, 2])
    return poses


class Core:
    """A survey of the particles; in place of the feed and of the reader."""

    def __init__(self):
        self.poses, self.past, self.epoch, self.N = histories(), 0, 0, N
        self.rng = np.random.default_rng(1)
        self.levelled = np.zeros((N, 3), np.float32)
        self.levelled[:, 1] = self.rng.uniform(-8.0, 8.0, N)
        x, y, _ = self.block([0], 0, N).placed(0).T
        self.levelled[:, 2] = depth(x, y) + 0.1 * self.rng.standard_normal(N)
        self.before_read = lambda: None

    def correct(self):
        """Bend the survey, more so the later it is."""
        self.poses = self.poses.copy()
        self.poses["y"] += np.linspace(0.0, 3.0, PINGS)
        self.past += 1

    def block(self, particles, first, size):
        whole = LogBlock(self.levelled, np.full(PINGS, BEAMS_OF_PING), self.poses[list(particles)])
        return whole.part(first, min(first + size, self.N))

    def take(self, timeout_s):
        beams = [self.draw(j, self.size) for j in self.particles()]
        return Minibatches(self.epoch, self.epoch, False, self.past, self.N, np.array(beams))

    def refresh(self):
        pass

    def read(self, particles, first, size):
        self.before_read()
        return Answer(self.epoch, self.past, self.N, self.block(particles, first, size))

    def sample(self, particle, size):
        return Answer(self.epoch, self.past, self.N, self.draw(particle, size))

    def draw(self, particle, size):
        placed = self.block([particle], 0, self.N).placed(0)
        return placed[self.rng.integers(0, self.N, size)]


@pytest.fixture
def core(monkeypatch):
    rostime.set_rostime_initialized(True)  # for throttled messages, without a node
    core = Core()

    def feed(particles, size, *_, **__):
        core.particles, core.size = particles, size
        return core

    monkeypatch.setattr(stream_training, "BeamReader", lambda: core)
    monkeypatch.setattr(stream_training, "LogFeed", lambda *_: feed(lambda: [], 1))
    monkeypatch.setattr(stream_training, "MinibatchFeed", feed)
    monkeypatch.setattr(stream_training, "TurnFeed", feed)
    monkeypatch.setattr(stream_training, "Background", lambda name: AtOnce())
    monkeypatch.setattr(stream_training, "READ_PERIOD_S", 0.0)
    return core


def node_of(group, in_turns=False):
    store = MapStore(0, PARTICLES, 1, group)
    return store, StreamTraining(store, group, lambda: None, (lambda: None) if in_turns else None)


class CountingGroup(GmrfGroup):
    """Counts the maps that each block goes into."""

    def __init__(self, config):
        super().__init__(config)
        self.folded, self.on_fold = [], lambda: None

    def take_in(self, maps, block):
        self.folded.append(len(maps))
        super().take_in(maps, block)
        self.on_fold()


def gmrf_group(spacing_m=1.5):
    group = CountingGroup(GmrfConfig(spacing_m, 12.0, 0.5, 0.1))
    rng = np.random.default_rng(0)
    xy = rng.uniform(0.0, 5.0, (40, 2))
    group.study(np.column_stack([xy, depth(*xy.T)]))  # all is known: nothing is learned
    return group


def predictions(store):
    positions = np.broadcast_to(PLACES, (PARTICLES, *PLACES.shape))
    return store.predict(store.epoch, list(store.own), positions)[:2]


# Maps that take in every beam once more


@pytest.mark.parametrize("in_turns", [False, True])
def test_maps_are_what_they_would_be_had_the_past_always_been_so(core, in_turns):
    (store, node), (fresh_store, fresh) = (node_of(gmrf_group(), in_turns) for _ in range(2))
    node.advance()
    before = predictions(store)
    core.correct()
    node.advance()
    fresh.advance()
    assert store.past == fresh_store.past == 1
    assert [one.next_beam for one in store.maps().values()] == [N] * PARTICLES
    after = predictions(store)
    # The same beams at the same places, with the same weights, added in the same order.
    np.testing.assert_array_equal(after, predictions(fresh_store))
    assert np.abs(after[0] - before[0]).max() > 0.1, "the correction can be seen"
    assert len(np.unique(after[0], axis=0)) == PARTICLES


def test_what_histories_share_is_folded_once_and_shared(core):
    group = gmrf_group(0.5)  # with tiles of 8 m, seven along the survey
    store, node = node_of(group)
    node.advance()
    group.folded.clear()
    core.correct()
    node.advance()
    # in blocks of 64 pings: histories part after pings 150 and 300
    assert group.folded == [1, 1, 4, 4, 5, 5, 5]
    maps = list(store.maps().values())
    whole = [len(one.to_bytes()) for one in maps]
    # Tiles that an earlier map has brought are not sent again: each but the first shares some.
    sent = [len(data) for data in group.serialise(maps, b"")]
    assert sent[0] == whole[0]
    assert all(part < 0.9 * all_of_it for part, all_of_it in zip(sent[1:], whole[1:]))


def test_the_old_maps_stay_until_all_new_ones_are_there(core):
    group = gmrf_group()
    store, node = node_of(group)
    node.advance()
    old, seen = dict(store.maps()), []
    iterations = [one.iterations for one in old.values()]
    group.on_fold = lambda: seen.append((store.past, dict(store.maps()) == old))
    core.correct()
    node.advance()
    assert set(seen) == {(0, True)}
    assert store.past == 1
    assert [one.iterations for one in store.maps().values()] == [2 * n for n in iterations]


def test_beams_that_come_meanwhile_are_taken_in_too(core):
    store, node = node_of(gmrf_group())
    core.N = 3000
    node.advance()
    core.correct()

    def grow():
        core.N = N

    core.before_read = grow
    node.advance()
    assert store.past == 1
    assert [one.next_beam for one in store.maps().values()] == [N] * PARTICLES


def test_a_newer_past_begins_it_again(core, monkeypatch):
    monkeypatch.setattr(stream_training, "REFOLD_BLOCKS", 1)
    store, node = node_of(gmrf_group())
    node.advance()
    core.correct()
    reads = []

    def correct_once_more():
        reads.append(1)
        if len(reads) == 3:
            core.correct()

    core.before_read = correct_once_more
    node.advance()
    assert store.past == 0 and store.newest_past == 2
    node.advance()
    assert store.past == 2
    fresh_store, fresh = node_of(gmrf_group())
    fresh.advance()
    np.testing.assert_array_equal(predictions(store), predictions(fresh_store))


def test_a_resampling_ends_it_and_it_begins_again(core, monkeypatch):
    monkeypatch.setattr(stream_training, "REFOLD_BLOCKS", 1)
    group = gmrf_group()
    store, node = node_of(group)
    node.advance()
    core.correct()
    ancestors = [0, 0, 2, 2, 4]

    def resample():
        group.on_fold = lambda: None
        # not from within a step, which holds the maps
        core.before_read = decide

    def decide():
        core.before_read = lambda: None
        store.prepare(1, ancestors, lambda epoch, wanted: {}, TIMEOUT_S)
        store.commit(1)
        core.epoch, core.poses = 1, core.poses[ancestors]

    group.on_fold = resample
    node.advance()
    assert (store.epoch, store.past) == (1, 0), "what was made is of the old particles"
    node.advance()
    assert store.past == 1
    fresh_store, fresh = node_of(gmrf_group())
    fresh_store.adopt(1)
    fresh.advance()
    np.testing.assert_array_equal(predictions(store), predictions(fresh_store))


def test_beams_placed_by_another_past_are_not_taken_in(core):
    store, node = node_of(gmrf_group())
    core.N = 2 * BLOCK_BEAMS
    node.advance()
    core.N = N
    core.before_read = core.correct  # every answer is of a newer past than the one before
    node.advance()
    assert [one.next_beam for one in store.maps().values()] == [2 * BLOCK_BEAMS] * PARTICLES
    assert store.newest_past == 1 and len(store.lagging()) == PARTICLES


def test_maps_without_a_beam_have_followed_every_past(core):
    core.past = 7
    store, node = node_of(gmrf_group())
    node.advance()
    assert store.past == 7 and store.lagging() == []


def test_a_refolding_that_fails_leaves_the_maps_as_they_are(core, monkeypatch):
    group = gmrf_group()
    store, node = node_of(group)
    node.advance()
    before = predictions(store)
    core.correct()
    with monkeypatch.context() as broken:
        broken.setattr(group, "take_in", lambda maps, block: 1 / 0)
        node.advance()
    assert store.past == 0
    np.testing.assert_array_equal(predictions(store), before)
    node.advance()
    assert store.past == 1


def test_one_map_serves_histories_that_never_part():
    new = Refolding(gmrf_group(), [3, 4, 5])
    block = LogBlock(np.float32([[0.0, 1.0, -40.0]] * 20), np.array([20]), np.ones((3, 1), POSE))
    for step in new.steps(block, 8):
        step()
    assert (new.folded, new.next_beam) == (20, 20)
    maps = new.maps()
    assert list(maps) == [3, 4, 5] and len(set(map(id, maps.values()))) == 3
    maps[3].take_in(np.array([[1.0, 1.0, -39.0]]))
    assert maps[4].next_beam == 20, "each goes on by itself"


def test_a_part_of_a_block_has_its_own_pings():
    poses = np.zeros((2, 3), POSE)
    poses["x"] = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]
    block = LogBlock(np.arange(30, dtype=np.float32).reshape(10, 3), np.array([4, 3, 3]), poses)
    part = block.part(2, 7)
    np.testing.assert_array_equal(part.beams_of_ping, [2, 3])
    np.testing.assert_array_equal(part.placed(1), block.placed(1)[2:7])
    assert part.poses.shape == (2, 2)


# Maps that have a teacher


def svgp_group():
    config = SvgpConfig(
        inducing_points=40, minibatch_size=50, optimizer="streaming", streaming_rebuild_beams=5000
    )
    return SvgpGroup(config, np.array([[0.0, 5.0], [50.0, 5.0], [50.0, 35.0], [0.0, 35.0]]))


@pytest.mark.parametrize("in_turns", [False, True])
def test_streaming_maps_follow_before_the_teacher_goes_on(core, monkeypatch, in_turns):
    monkeypatch.setattr(stream_training, "REBUILD_SHARE", 1e-9)  # one, and never again
    group = svgp_group()
    store, node = node_of(group, in_turns)
    core.N = 4000
    for _ in range(5):
        node.advance()
    core.correct()
    taught = []
    train_step = group.teacher.train_step
    monkeypatch.setattr(
        group.teacher, "train_step", lambda *of: (taught.append(store.past), train_step(*of))
    )
    latest = store.maps()[0].common.latest()
    node.advance()
    assert store.past == 1 and set(taught) == {1}
    for j, one in store.maps().items():
        assert one.optimizer.fixed is latest and one.next_beam == 4000
        alone = group.create_anew()
        alone.optimizer.fixed = latest  # the teacher has gone on
        alone.take_in(core.block([j], 0, 4000).placed(0))
        # The same sums, of correlations in single precision.
        np.testing.assert_allclose(one.predict(PLACES)[0], alone.predict(PLACES)[0], atol=1e-3)


def test_streaming_maps_are_made_of_a_sample_of_a_long_log(core, monkeypatch):
    group = svgp_group()
    store, node = node_of(group)
    for _ in range(3):
        node.advance()
    core.correct()
    taken = []
    take_in = group.take_in
    monkeypatch.setattr(
        group, "take_in", lambda maps, block: (taken.append(len(block)), take_in(maps, block))
    )
    node.advance()
    assert store.past == 1
    assert [one.next_beam for one in store.maps().values()] == [N] * PARTICLES
    # Some 5000 beams in five blocks, for 1, 4, 4, 5 and 5 maps: what histories share counts once.
    assert sum(taken) == pytest.approx((1 + 4 + 4 + 5) * 1024 + 5 * 904, rel=0.05)
    mean, variance = store.maps()[3].predict(PLACES)
    whole = group.create_anew()
    whole.take_in(core.block([3], 0, N).placed(0))
    # 5000 of 6400 beams leave out little: they agree within two standard deviations of the map.
    assert (np.abs(mean - whole.predict(PLACES)[0]) < 2.0 * np.sqrt(variance)).all()


def test_a_map_that_refuses_its_beams_is_not_exchanged(core, monkeypatch):
    group = svgp_group()
    store, node = node_of(group)
    node.advance()
    core.correct()
    with monkeypatch.context() as broken:
        broken.setattr(group, "take_in", lambda maps, block: None)
        node.advance()
    assert store.past == 0
    node.advance()
    assert store.past == 1


# Maps of other nodes


def test_heirs_have_the_past_of_their_ancestors():
    stores = make_stores(4, 2)
    stores[0].follow_at_once(2)
    stores[1].follow_at_once(1)
    prepare_all(stores, 1, [3, 1, 0, 3])
    assert [store.past for store in stores] == [2, 1]
    for store in stores:
        store.commit(1)
    assert stores[0].past == 1 and stores[0].lagging() == [0]
    # That of particle 2 has followed more than its new node knew of.
    assert stores[1].past == 1 and stores[1].lagging() == [3]
    stores[1].follow_at_once(2)
    stores[0].follow_at_once(2)
    assert [store.past for store in stores] == [2, 2]
    assert all(store.train(store.own[0], 1, BEAMS, 7) for store in stores)


def test_an_undone_resampling_leaves_the_pasts_alone():
    stores = make_stores(4, 2)
    stores[0].follow_at_once(1)
    assert prepare_all(stores, 1, [3, 3, 3, 3])[0].maps == 1
    for store in stores:
        store.abort(1)
    assert [store.past for store in stores] == [1, 0]
