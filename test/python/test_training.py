"""The training of a node's maps, with a core that is a log and an epoch."""

from concurrent.futures import Future
from types import SimpleNamespace

import numpy as np
import pytest
from rospy import rostime

from rbpf_svgp_slam.map_node import stream_training, training
from rbpf_svgp_slam.map_node.background import AtOnce, carry_out
from rbpf_svgp_slam.map_node.core_client import Answer, Minibatches
from rbpf_svgp_slam.map_node.map_store import MapStore
from rbpf_svgp_slam.map_node.stream_training import StreamTraining
from rbpf_svgp_slam.map_node.training import MinibatchTraining
from rbpf_svgp_slam.maps import make_group
from rbpf_svgp_slam.maps.log_block import POSE, LogBlock
from rbpf_svgp_slam.svgp.config import SvgpConfig

AREA = [[-15.0, -15.0], [15.0, -15.0], [15.0, 15.0], [-15.0, 15.0]]
CONFIG = SvgpConfig(inducing_points=30, minibatch_size=100, streaming_rebuild_beams=2500)


class Core:
    """Answers as the core does; particle j sees everything shifted by j cm."""

    def __init__(self):
        rng = np.random.default_rng(0)
        xy = rng.uniform(-15.0, 15.0, (20000, 2))
        z = np.sin(xy[:, 0] / 4.0) - 30.0 + 0.1 * rng.standard_normal(20000)
        self.log = np.column_stack([xy, z]).astype(np.float32)
        self.N, self.epoch, self.past, self.rng = 0, 0, 0, rng
        self.samples, self.reads, self.gone = [], [], False
        self.survey = 7

    def placed(self, particle, indices):
        return self.log[indices] + np.float32([0.01 * particle, 0.0, 0.0])

    # MinibatchFeed
    def take(self, timeout_s):
        self.asked = list(self.particles())
        beams = [self.placed(j, self.rng.integers(0, self.N, self.size)) for j in self.asked]
        return Minibatches(
            self.epoch, self.epoch, False, self.past, self.N, np.array(beams), self.survey
        )

    def refresh(self):
        pass

    # BeamReader
    def read(self, particles, first, size):
        self.reads.append(list(particles))
        if self.gone:
            return None
        beams = self.log[first : min(first + size, self.N)]
        poses = np.zeros((len(particles), 1), POSE)
        poses["x"][:, 0], poses["cos"] = [0.01 * j for j in particles], 1.0
        return Answer(self.epoch, self.past, self.N, LogBlock(beams, np.array([len(beams)]), poses))

    def sample(self, particle, size):
        self.samples.append(size)
        beams = self.placed(particle, self.rng.integers(0, self.N, size))
        return Answer(self.epoch, self.past, self.N, beams)


@pytest.fixture
def core(monkeypatch):
    rostime.set_rostime_initialized(True)  # for throttled messages, without a node
    core = Core()

    def feed(particles, size, epoch):
        core.particles, core.size = particles, size
        return core

    monkeypatch.setattr(training, "MinibatchFeed", feed)
    monkeypatch.setattr(stream_training, "MinibatchFeed", feed)
    monkeypatch.setattr(stream_training, "BeamReader", lambda: core)
    monkeypatch.setattr(stream_training, "REBUILD_SHARE", 1.0)  # no pauses
    monkeypatch.setattr(stream_training, "READ_PERIOD_S", 0.0)
    monkeypatch.setattr(stream_training, "Background", lambda name: AtOnce())
    return core


def make(training_class, optimizer, particles=3):
    parameters = SimpleNamespace(
        map=SimpleNamespace(engine="svgp"),
        survey_area=AREA,
        engine_group={**CONFIG.as_dict(), "optimizer": optimizer},
    )
    group = make_group(parameters)
    store = MapStore(0, particles, 1, group)
    return store, group, training_class(store, group, lambda: None)


def test_minibatches_train_every_map_in_turn(core):
    store, _, node = make(MinibatchTraining, "natgrad")
    core.N = 5000
    for _ in range(4):
        node.advance()
    assert core.asked == [0, 1, 2]
    assert [engine.iterations for engine in store.maps().values()] == [4, 4, 4]
    assert store.steps == 12


@pytest.mark.parametrize(
    "training_class, optimizer", [(MinibatchTraining, "natgrad"), (StreamTraining, "streaming")]
)
def test_maps_learn_nothing_of_another_survey(core, training_class, optimizer):
    store, _, node = make(training_class, optimizer)
    core.N = 500
    node.advance()
    steps = store.steps
    assert steps > 0 and not store.superseded
    core.survey, core.epoch = 8, 3
    node.advance()
    node.advance()
    assert store.superseded, "the node has to make its maps anew"
    assert (store.steps, store.epoch, store.survey) == (steps, 0, 7)


def test_a_map_that_fails_does_not_stop_the_others(core, monkeypatch):
    store, _, node = make(MinibatchTraining, "natgrad")
    core.N = 5000
    monkeypatch.setattr(store.maps()[1], "train_step", lambda *args: 1 / 0)
    node.advance()
    assert [store.maps()[j].iterations for j in range(3)] == [1, 0, 1]
    assert store.skipped_steps == 1


def test_streaming_maps_take_in_all_beams_of_their_own_particle_once(core):
    store, group, node = make(StreamTraining, "streaming")
    taught_with = []
    for core.N in (100, 1000, 2200):
        for _ in range(6):
            node.advance()
            taught_with += core.asked
    assert taught_with == [0, 1, 2] * 6
    assert group.teacher.iterations == 18
    for j, engine in store.maps().items():
        assert engine.next_beam == 2200
        alone = group.create()
        alone.rebuild(core.placed(j, np.arange(2200)), 2200)
        if engine.optimizer.fixed is alone.optimizer.fixed:
            # Sums in another order, of correlations in single precision.
            mean, _ = engine.predict(core.log[:50, :2])
            np.testing.assert_allclose(mean, alone.predict(core.log[:50, :2])[0], atol=1e-3)
    assert core.samples == []  # the log is short enough to be taken whole


def test_maps_are_up_to_date_before_the_teacher_goes_on(core):
    store, group, node = make(StreamTraining, "streaming")
    core.N = 100
    node.advance()
    steps = group.teacher.iterations
    core.N, core.particles = 10000, lambda: []  # a turn without rounds
    node.advance()
    assert [engine.next_beam for engine in store.maps().values()] == [10000] * 3
    assert group.teacher.iterations == steps


def test_a_map_that_takes_in_nothing_does_not_hold_up_the_others(core, monkeypatch):
    store, group, node = make(StreamTraining, "streaming")
    core.N = 5000
    monkeypatch.setattr(store.maps()[1], "take_in", lambda beams: 1 / 0)
    monkeypatch.setattr(store, "outdated", lambda: [])
    node.advance()
    assert [engine.next_beam for engine in store.maps().values()] == [5000, 0, 5000]
    assert group.teacher.iterations == 1


def test_maps_are_rebuilt_in_turn_and_from_a_sample_of_a_long_log(core):
    store, group, node = make(StreamTraining, "streaming")
    core.N = 20000
    for _ in range(20):
        node.advance()
    assert set(core.samples) == {2500}
    # 20 rebuilds over 3 maps, and blocks: a rebuilt map has the whole log at once
    assert all(engine.next_beam == 20000 for engine in store.maps().values())
    for _ in range(60):
        group.teacher.train_step(core.placed(0, core.rng.integers(0, 20000, 100)), 20000)
    assert len(store.outdated()) == 3
    node.advance()
    assert len(store.outdated()) < 3


def test_beams_of_another_epoch_are_not_taken_in(core):
    store, _, node = make(StreamTraining, "streaming")
    core.N = 1000
    node.advance()
    before = {j: engine.next_beam for j, engine in store.maps().items()}
    core.N = 2000
    read = core.read

    def overtaken(particles, first, size):
        core.epoch = 1
        return read(particles, first, size)

    core.read = overtaken
    node.advance()
    assert {j: engine.next_beam for j, engine in store.maps().items()} == before


def test_a_core_that_does_not_answer_costs_nothing(core):
    store, _, node = make(StreamTraining, "streaming")
    core.N, core.gone = 1000, True
    for _ in range(3):
        node.advance()
    core.gone = False
    for _ in range(4):
        node.advance()
    assert all(engine.next_beam == 1000 for engine in store.maps().values())


def test_a_copy_goes_on_where_its_ancestor_was(core):
    store, _, node = make(StreamTraining, "streaming")
    core.N = 512
    node.advance()
    store.prepare(1, [0, 0, 2], lambda epoch, wanted: {}, 1.0)
    assert store.frozen
    store.commit(1)
    core.epoch = 1
    core.N = 1500
    for _ in range(3):
        node.advance()
    assert [engine.next_beam for engine in store.maps().values()] == [1500] * 3


class Later:
    """In place of a Background: results come when they are told to."""

    def __init__(self):
        self.calls = []

    def submit(self, call, *arguments):
        self.calls.append((Future(), call, arguments))
        return self.calls[-1][0]

    def answer(self):
        while self.calls:
            carry_out(*self.calls.pop(0))


def test_the_teacher_goes_on_while_beams_are_on_their_way(core, monkeypatch):
    later = Later()
    monkeypatch.setattr(stream_training, "Background", lambda name: later)
    store, group, node = make(StreamTraining, "streaming")
    core.N = 1000
    for _ in range(5):
        node.advance()
    assert group.teacher.iterations == 5
    assert {engine.next_beam for engine in store.maps().values()} == {0}
    while later.calls:
        later.answer()
        node.advance()
    assert {engine.next_beam for engine in store.maps().values()} == {1000}
    assert core.reads[0] == [0, 1, 2]


def test_beams_that_a_resampling_overtakes_are_asked_for_again(core, monkeypatch):
    later = Later()
    monkeypatch.setattr(stream_training, "Background", lambda name: later)
    store, _, node = make(StreamTraining, "streaming")
    core.N = 1000
    node.advance()
    later.answer()  # placed under epoch 0
    store.prepare(1, [0, 0, 2], lambda epoch, wanted: {}, 1.0)
    store.commit(1)
    core.epoch = 1
    node.advance()
    assert {engine.next_beam for engine in store.maps().values()} == {0}
    for _ in range(3):
        node.advance()
        later.answer()
    assert {engine.next_beam for engine in store.maps().values()} == {1000}
