"""Maps that are plain numbers, for tests of what is done with maps."""

import math
import struct
import threading
import time
from contextlib import contextmanager

import numpy as np

from rbpf_svgp_slam.map_node.map_store import MapStore, SentMap
from rbpf_svgp_slam.maps import MapGroup

TIMEOUT_S = 5.0  # for what is expected to happen: reached only by a bug
SHORT_S = 0.05  # for what is expected not to happen
BEAMS = np.ones((4, 3), dtype=np.float32)


class NumberMap:
    """A map that is one number. Maps of one node share a guard, as real ones share work space."""

    noise_variance_m2 = 0.25
    prior_variance_m2 = 4.0

    def __init__(self, group, value=0.0, iterations=0):
        self.group, self.value, self.iterations = group, value, iterations
        self.skipped_steps = 0

    def train_step(self, beams, beams_in_log):
        with self.group.alone():
            if math.isnan(beams[0, 0]):
                raise RuntimeError("this minibatch is broken")
            if beams[0, 0] < 0:
                self.skipped_steps += 1
                return
            time.sleep(self.group.step_s)
            self.value += float(beams.sum()) / beams_in_log
            self.iterations += 1

    def rebuild(self, beams, beams_in_log, pause):
        value = 0.0
        for beam in beams:
            with self.group.alone():
                value += float(beam.sum())
            pause()
        self.value = value
        self.iterations += 1

    def predict(self, xy):
        with self.group.alone():
            return self.value + xy[:, 0], np.full(len(xy), 0.5)

    def copy(self):
        with self.group.alone():
            return NumberMap(self.group, self.value, self.iterations)

    def to_bytes(self):
        with self.group.alone():
            return struct.pack("<dQ", self.value, self.iterations)


class NumberMaps(MapGroup):
    """The maps of one node. Fails when two threads use them at once."""

    map_class = NumberMap
    from_parameters = load_saved = None

    def __init__(self, step_s=0.0):
        self.step_s = step_s
        self.guard = threading.Lock()

    def create(self):
        return NumberMap(self)

    def load(self, data):
        with self.alone():
            return NumberMap(self, *struct.unpack("<dQ", data))

    @contextmanager
    def alone(self):
        assert self.guard.acquire(blocking=False), "two threads use the maps at the same time"
        try:
            yield
        finally:
            self.guard.release()


def make_stores(particles, nodes):
    stores = [MapStore(k, particles, nodes, NumberMaps()) for k in range(nodes)]
    for store in stores:
        for particle in store.own:
            # Every map is different: particle j has seen j + 1 steps.
            for _ in range(particle + 1):
                assert store.train(particle, 0, BEAMS, 7)
    return stores


def map_bytes(stores):
    return {j: engine.to_bytes() for store in stores for j, engine in store.maps().items()}


def fetch_from(stores, timeout_s=TIMEOUT_S):
    """What the services do between nodes."""

    def fetch(epoch, wanted):
        sent = {}
        for owner, particles in wanted.items():
            maps, pasts = stores[owner].hand_over(epoch, particles, timeout_s, None)
            sent.update(zip(particles, map(SentMap, maps, pasts)))
        return sent

    return fetch


def no_fetch(epoch, wanted):
    raise AssertionError(f"nothing to fetch was expected, asked for {wanted}")


def in_threads(*calls):
    """Run calls at the same time; their results, or the exceptions they raised."""
    results = [None] * len(calls)

    def run(i):
        try:
            results[i] = calls[i]()
        except Exception as error:
            results[i] = error

    threads = [threading.Thread(target=run, args=(i,), daemon=True) for i in range(len(calls))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(TIMEOUT_S)
        assert not thread.is_alive(), "deadlock"
    return results


def prepare_all(stores, epoch, ancestors):
    fetch = fetch_from(stores)
    return in_threads(*(lambda s=s: s.prepare(epoch, ancestors, fetch, TIMEOUT_S) for s in stores))
