"""Arrays on the wire, and the turns that training steps and requests take."""

import struct
import threading
import time

import numpy as np
import pytest

from rbpf_svgp_slam.map_node.step_lock import StepLock
from rbpf_svgp_slam.protocol.payload import BadRequest, pack, split, unpack

TIMEOUT_S = 5.0  # for what is expected to happen: reached only by a bug
QUEUEING_S = 0.05  # for a thread to get as far as the lock


def test_requests_go_before_steps():
    lock = StepLock()
    order = []

    def take(turn, name):
        with turn():
            order.append(name)

    threads = [
        threading.Thread(target=take, args=(lock.step, "step")),
        threading.Thread(target=take, args=(lock.request, "request")),
    ]
    with lock.step():
        for thread in threads:
            thread.start()
            time.sleep(QUEUEING_S)
    for thread in threads:
        thread.join(TIMEOUT_S)
    assert order == ["request", "step"]


def test_arrays_survive_the_wire():
    array = np.random.default_rng(0).normal(size=(2, 3, 2)).astype(np.float32)
    data = pack(array)
    assert len(data) == 48 and data[:4] == struct.pack("<f", array[0, 0, 0])
    np.testing.assert_array_equal(unpack("positions", data, (2, 3, 2)), array)


def test_bad_payloads_are_refused_with_a_reason():
    with pytest.raises(BadRequest, match=r"positions has 5 bytes; expected 16: float32 \[2, 2\]"):
        unpack("positions", b"12345", (2, 2))
    array = np.array([[0, 1], [np.nan, 3]], dtype=np.float32)
    with pytest.raises(BadRequest, match=r"positions\[1, 0\] is nan; expected finite"):
        unpack("positions", pack(array), (2, 2))
    with pytest.raises(BadRequest, match="maps has 5 bytes; expected 6, the sum of its sizes"):
        split("maps", b"12345", [2, 4])
    assert split("maps", b"12345", [2, 0, 3]) == [b"12", b"", b"345"]


def test_a_long_step_lets_requests_in_where_it_gives_way():
    lock, log = StepLock(), []

    def request():
        with lock.request():
            log.append("request")

    with lock.step():
        lock.give_way()  # nobody waits
        asker = threading.Thread(target=request, daemon=True)
        asker.start()
        while lock._requests_waiting == 0:
            time.sleep(0.001)
        log.append("first half")
        lock.give_way()
        log.append("second half")
    asker.join(TIMEOUT_S)
    assert log == ["first half", "request", "second half"]
