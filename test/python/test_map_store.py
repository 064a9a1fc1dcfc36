"""The two phases of a resampling, with maps that are plain numbers."""

import struct
import threading
import time

import numpy as np
import pytest
from number_maps import BEAMS, SHORT_S, TIMEOUT_S, fetch_from, make_stores, map_bytes, no_fetch
from number_maps import prepare_all

from rbpf_svgp_slam.map_node.map_store import Fetched, SentMap
from rbpf_svgp_slam.protocol.payload import BadRequest


def test_commit_gives_every_particle_its_ancestors_map():
    stores = make_stores(5, 2)
    before = map_bytes(stores)
    ancestors = [4, 1, 1, 0, 4]
    moved = prepare_all(stores, 1, ancestors)
    assert [m.maps for m in moved] == [1, 1]
    assert [m.bytes for m in moved] == [16, 16]
    assert map_bytes(stores) == before, "the old maps stay until the commit"
    for store in stores:
        store.commit(1)
    assert map_bytes(stores) == {j: before[a] for j, a in enumerate(ancestors)}
    assert [store.epoch for store in stores] == [1, 1]


def test_survivors_keep_their_objects_and_copies_are_independent():
    (store,) = make_stores(3, 1)
    survivor = store.maps()[1]
    store.prepare(1, [1, 1, 1], no_fetch, TIMEOUT_S)
    store.commit(1)
    assert store.maps()[1] is survivor
    before = store.maps()[2].to_bytes()
    store.train(0, 1, BEAMS, 7)
    assert store.maps()[2].to_bytes() == before != store.maps()[0].to_bytes()


def test_abort_keeps_everything():
    stores = make_stores(4, 2)
    before = map_bytes(stores)
    prepare_all(stores, 1, [3, 3, 0, 0])
    for store in stores:
        store.abort(1)
    assert map_bytes(stores) == before
    assert [store.epoch for store in stores] == [0, 0]
    assert all(store.train(store.own[0], 0, BEAMS, 7) for store in stores)


def test_decisions_can_be_repeated():
    (store,) = make_stores(2, 1)
    store.prepare(1, [0, 0], no_fetch, TIMEOUT_S)
    store.abort(1)
    store.abort(1)
    store.prepare(1, [0, 0], no_fetch, TIMEOUT_S)
    store.commit(1)
    store.commit(1)
    assert store.epoch == 1
    with pytest.raises(BadRequest, match="epoch is 1; expected 2"):
        store.abort(1)


def test_no_training_between_the_phases():
    (store,) = make_stores(2, 1)
    store.prepare(1, [0, 0], no_fetch, TIMEOUT_S)
    before = map_bytes([store])
    assert store.frozen
    assert not store.train(0, 0, BEAMS, 7)
    assert not store.train(0, 1, BEAMS, 7)
    assert map_bytes([store]) == before
    store.commit(1)
    assert not store.train(0, 0, BEAMS, 7), "beams of another epoch"
    assert store.train(0, 1, BEAMS, 7)


def test_maps_are_handed_out_only_once_their_owner_has_stopped():
    first, second = make_stores(2, 2)
    answers = []
    asker = threading.Thread(
        target=lambda: answers.extend(second.serialise(1, [1], TIMEOUT_S)), daemon=True
    )
    asker.start()
    time.sleep(SHORT_S)
    assert not answers
    second.train(1, 0, BEAMS, 7)
    at_resampling = second.maps()[1].to_bytes()
    second.prepare(1, [0, 1], no_fetch, TIMEOUT_S)
    asker.join(TIMEOUT_S)
    assert answers == [at_resampling]


def test_a_picture_of_a_map_may_be_had_in_any_epoch():
    (store,) = make_stores(2, 1)
    for _ in range(2):
        assert store.serialise(None, [1], SHORT_S) == [store.maps()[1].to_bytes()]
        store.prepare(store.epoch + 1, [0, 0], no_fetch, TIMEOUT_S)
        # with the resampling undecided, what has been so far
        assert store.serialise(None, [1], SHORT_S) == [store.maps()[1].to_bytes()]
        store.commit(store.epoch + 1)
        store.train(1, store.epoch, BEAMS, 7)
    with pytest.raises(BadRequest, match="particle is 2"):
        store.serialise(None, [2], SHORT_S)


def test_what_would_take_too_much_memory_or_time_is_refused():
    (store,) = make_stores(30, 1)
    with pytest.raises(BadRequest, match="100001 points of 1 particles; expected at most 100000"):
        store.predict(0, [0], np.zeros((1, 100_001, 2), np.float32))
    with pytest.raises(BadRequest, match="70000 points of 30 particles; .* and 2000000 in all"):
        store.predict(0, list(range(30)), np.zeros((30, 70_000, 2), np.float32))
    mean, _, _ = store.predict(0, [0], np.ones((1, 100_000, 2), np.float32))
    assert mean.shape == (1, 100_000)
    for ask in (store.serialise, store.hand_over):
        known = (b"",) if ask == store.hand_over else ()
        with pytest.raises(
            BadRequest, match="1000 particles, not all different; expected each once"
        ):
            ask(0, [1] * 1000, SHORT_S, *known)


def test_a_node_that_never_stops_is_given_up():
    stores = make_stores(2, 2)
    with pytest.raises(BadRequest, match="not stopped training for epoch 1 within 0.05 s"):
        stores[0].prepare(1, [1, 1], fetch_from(stores, SHORT_S), TIMEOUT_S)
    assert stores[0].frozen, "other nodes may still be fetching from it"
    with pytest.raises(BadRequest, match="not fully prepared"):
        stores[0].commit(1)
    stores[0].abort(1)
    assert stores[0].train(0, 0, BEAMS, 7)


def test_abort_during_preparation_wins():
    (store, _) = make_stores(2, 2)

    def fetch(epoch, wanted):
        store.abort(1)
        return {1: SentMap(struct.pack("<dQ", 0.0, 0), 0)}

    with pytest.raises(BadRequest, match="ended while its maps were being fetched"):
        store.prepare(1, [1, 1], fetch, TIMEOUT_S)
    assert not store.frozen
    with pytest.raises(BadRequest, match="nothing is prepared"):
        store.commit(1)


def test_a_second_plan_replaces_the_first():
    (store,) = make_stores(3, 1)
    before = map_bytes([store])
    store.prepare(1, [0, 0, 0], no_fetch, TIMEOUT_S)
    store.prepare(1, [2, 2, 2], no_fetch, TIMEOUT_S)
    store.commit(1)
    assert map_bytes([store]) == dict.fromkeys(range(3), before[2])


@pytest.mark.parametrize(
    "epoch, ancestors, message",
    [
        (0, [0, 1], "epoch is 0; expected 1"),
        (2, [0, 1], "epoch is 2; expected 1"),
        (1, [0], "ancestors has 1 entries; expected 2"),
        (1, [0, 2], r"ancestors\[1\] is 2; expected 0 .. 1"),
    ],
)
def test_a_bad_plan_changes_nothing(epoch, ancestors, message):
    (store,) = make_stores(2, 1)
    with pytest.raises(BadRequest, match=message):
        store.prepare(epoch, ancestors, no_fetch, TIMEOUT_S)
    assert not store.frozen


def test_many_resamplings_while_all_nodes_train():
    """No deadlock, and at every commit each map is its ancestor's at the time of freezing."""
    stores = make_stores(7, 3)
    trained_epoch = 0
    stop = threading.Event()

    def train(store):
        while not stop.is_set():
            store.wait_while_frozen(SHORT_S)
            for particle in store.own:
                store.train(particle, trained_epoch, BEAMS, 7)

    trainers = [threading.Thread(target=train, args=(s,), daemon=True) for s in stores]
    for trainer in trainers:
        trainer.start()
    random = np.random.default_rng(3)
    for epoch in range(1, 31):
        ancestors = random.integers(7, size=7).tolist()
        moved = prepare_all(stores, epoch, ancestors)
        assert all(isinstance(m, Fetched) for m in moved), moved
        before = map_bytes(stores)
        for store in stores:
            store.commit(epoch)
        # Nothing is trained before this thread says that the beams are of the new epoch.
        assert map_bytes(stores) == {j: before[a] for j, a in enumerate(ancestors)}
        steps = [store.steps for store in stores]
        trained_epoch = epoch
        while any(store.steps == before for store, before in zip(stores, steps)):
            time.sleep(0.001)
    stop.set()
    for trainer in trainers:
        trainer.join(TIMEOUT_S)


# Decisions that never come


def prepared_and_overdue(monkeypatch):
    (store,) = make_stores(2, 1)
    store.prepare(1, [1, 1], no_fetch, TIMEOUT_S)
    assert not store.undecided()
    now_s = time.monotonic()
    monkeypatch.setattr(time, "monotonic", lambda: now_s + TIMEOUT_S + 1)
    assert store.undecided()
    return store


def test_the_core_says_committed(monkeypatch):
    store = prepared_and_overdue(monkeypatch)
    assert store.settle(core_epoch=1, core_resampling=False) == "committed"
    assert (store.epoch, store.frozen) == (1, False)
    assert store.maps()[0].iterations == 2


def test_the_core_says_given_up(monkeypatch):
    store = prepared_and_overdue(monkeypatch)
    assert store.settle(core_epoch=0, core_resampling=False) == "aborted"
    assert (store.epoch, store.frozen) == (0, False)
    assert store.maps()[0].iterations == 1


def test_the_core_is_still_at_it(monkeypatch):
    store = prepared_and_overdue(monkeypatch)
    assert store.settle(core_epoch=0, core_resampling=True) == ""
    assert store.frozen
    assert not store.undecided(), "the next question comes later"


def test_nothing_to_settle():
    (store,) = make_stores(2, 1)
    assert store.settle(core_epoch=1, core_resampling=False) == ""
    store.prepare(1, [0, 0], no_fetch, TIMEOUT_S)
    assert store.settle(core_epoch=1, core_resampling=False) == "", "not overdue yet"


def test_maps_are_of_the_first_survey_that_is_heard_of():
    (store,) = make_stores(2, 1)
    assert store.hear_survey(0), "an offline replay, or a core of old"
    assert store.hear_survey(7) and store.survey == 7
    store.check_survey(7)
    assert not store.superseded
    with pytest.raises(BadRequest, match="survey is 9; expected 7, this node's"):
        store.check_survey(9)
    assert not store.superseded, "anybody may ask"
    assert not store.hear_survey(9)
    assert store.superseded and not store.hear_survey(7), "they are of no use any more"
