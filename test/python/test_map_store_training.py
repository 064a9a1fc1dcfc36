"""Training and predictions of a node's maps, with maps that are plain numbers."""

import math
import threading
import time

import numpy as np
import pytest
from number_maps import BEAMS, TIMEOUT_S, NumberMaps, make_stores, map_bytes, no_fetch

from rbpf_svgp_slam.map_node.map_store import MapStore
from rbpf_svgp_slam.protocol.payload import BadRequest


def test_failed_and_skipped_steps_are_counted():
    (store,) = make_stores(1, 1)
    with pytest.raises(RuntimeError, match="broken"):
        store.train(0, 0, np.full((4, 3), np.nan), 7)
    assert store.train(0, 0, -BEAMS, 7)
    assert (store.steps, store.skipped_steps) == (1, 2)


def test_predictions_are_each_maps_own():
    (store,) = make_stores(3, 1)
    positions = np.arange(12, dtype=np.float32).reshape(2, 3, 2)
    mean, variance, prior = store.predict(0, [2, 0], positions)
    values = [store.maps()[2].value, store.maps()[0].value]
    np.testing.assert_allclose(mean, positions[:, :, 0] + np.c_[values], rtol=1e-6)  # float32
    assert (variance == 0.5).all() and (prior == 4.0).all()


def test_predictions_are_refused_with_a_reason():
    stores = make_stores(4, 2)
    positions = np.zeros((1, 3, 2), dtype=np.float32)
    with pytest.raises(BadRequest, match="epoch is 1; expected 0"):
        stores[1].predict(1, [2], positions)
    with pytest.raises(BadRequest, match="particle is 1; expected 2 .. 3"):
        stores[1].predict(0, [1], positions)
    stores[1].maps()[3].value = math.nan
    with pytest.raises(BadRequest, match="prediction of particle 3 is not finite"):
        stores[1].predict(0, [2, 3], np.zeros((2, 3, 2)))


def long_rebuild(store, request):
    """What a rebuild returns that a request comes in the midst of, and what the request does."""
    answers = []

    def ask():
        answers.append(request())

    asker = threading.Thread(target=ask, daemon=True)

    class Beams(list):
        """Starts the request with the first beam, and waits until it stands in line."""

        def __iter__(self):
            for i, beam in enumerate(list.__iter__(self)):
                if i == 1:
                    asker.start()
                    while store._lock._requests_waiting == 0:
                        time.sleep(0.001)
                yield beam

    done = store.rebuild(0, 0, Beams(BEAMS), 4)
    asker.join(TIMEOUT_S)
    return done, answers


def test_a_rebuild_lets_predictions_in():
    (store,) = make_stores(1, 1)
    before = store.maps()[0].value
    positions = np.zeros((1, 2, 2), dtype=np.float32)
    done, (prediction,) = long_rebuild(store, lambda: store.predict(0, [0], positions))
    np.testing.assert_allclose(prediction[0], before, rtol=1e-6)  # float32
    assert done and store.maps()[0].value == BEAMS.sum()


def test_a_resampling_ends_a_rebuild_without_effect():
    (store,) = make_stores(2, 1)
    before, steps = map_bytes([store]), store.steps
    done, _ = long_rebuild(store, lambda: store.prepare(1, [1, 0], no_fetch, TIMEOUT_S))
    assert not done and map_bytes([store]) == before
    assert (store.steps, store.skipped_steps) == (steps, 0)


def test_a_prediction_waits_for_one_step_at_most():
    step_s = 0.02
    store = MapStore(0, 10, 1, NumberMaps(step_s))
    stop = threading.Event()

    def train():
        while not stop.is_set():
            for particle in store.own:
                store.train(particle, 0, BEAMS, 7)

    trainer = threading.Thread(target=train, daemon=True)
    trainer.start()
    waits_s = []
    for _ in range(20):
        time.sleep(0.003)
        start_s = time.monotonic()
        store.predict(0, [0], np.zeros((1, 2, 2), dtype=np.float32))
        waits_s.append(time.monotonic() - start_s)
    stop.set()
    trainer.join(TIMEOUT_S)
    # Two steps rather than one leave room for a busy machine; without fairness it is a dozen.
    assert np.median(waits_s) < 2 * step_s
