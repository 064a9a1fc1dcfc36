"""Fetches maps from the other map nodes."""

from __future__ import annotations

import queue
import threading
import time
from typing import Callable

import rospy

from rbpf_svgp_slam.map_node.map_store import SentMap
from rbpf_svgp_slam.protocol import names
from rbpf_svgp_slam.protocol.payload import BadRequest, split
from rbpf_svgp_slam.srv import FetchMaps, FetchMapsResponse


class Peers:
    """The other map nodes, by their index; their names follow from it."""

    def __init__(self, engine: str, timeout_s: float, known_pieces: Callable[[], bytes]) -> None:
        """known_pieces: what the peers need not send (MapGroup.known_pieces)."""
        self._engine = engine
        self._known_pieces = known_pieces
        self._timeout_s = timeout_s

    def fetch(self, epoch: int, wanted: dict[int, list[int]]) -> dict[int, SentMap]:
        """Maps by particle, as they are when their owners have stopped training for the epoch.

        wanted: particles by owner. All owners are asked at the same time, each once.
        """
        known = self._known_pieces()
        deadline_s = time.monotonic() + self._timeout_s
        answers: queue.SimpleQueue[tuple[int, FetchMapsResponse | Exception]] = queue.SimpleQueue()
        proxies = {}
        for owner, particles in wanted.items():
            # Persistent, so that it can be closed from here if the peer does not answer in time.
            proxies[owner] = rospy.ServiceProxy(names.fetch_maps(owner), FetchMaps, persistent=True)
            threading.Thread(
                target=_ask,
                args=(owner, lambda o=owner, p=particles: proxies[o](epoch, p, known), answers),
                daemon=True,
            ).start()
        maps: dict[int, SentMap] = {}
        missing = set(wanted)
        try:
            while missing:
                owner, answer = answers.get(timeout=max(0.0, deadline_s - time.monotonic()))
                missing.remove(owner)
                maps.update(self._maps(owner, wanted[owner], answer))
        except queue.Empty:
            silent = ", ".join(names.fetch_maps(owner) for owner in sorted(missing))
            raise BadRequest(
                f"no answer from {silent} after {self._timeout_s:g} s; expected maps"
            ) from None
        finally:
            for proxy in proxies.values():
                proxy.close()
        return maps

    def _maps(
        self, owner: int, particles: list[int], answer: FetchMapsResponse | Exception
    ) -> dict[int, SentMap]:
        service = names.fetch_maps(owner)
        if isinstance(answer, Exception):
            raise BadRequest(f"{service} failed: {answer}") from answer
        if not answer.success:
            raise BadRequest(f"{service} refused: {answer.message}")
        if answer.engine != self._engine:
            raise BadRequest(
                f"maps from {service} are of engine {answer.engine}; "
                f"expected {self._engine}, map/engine of this node"
            )
        for name, sent in (("maps", answer.sizes), ("pasts", answer.pasts)):
            if len(sent) != len(particles):
                raise BadRequest(f"{service} sent {len(sent)} {name}; expected {len(particles)}")
        data = split("maps", answer.maps, list(answer.sizes))
        return dict(zip(particles, map(SentMap, data, answer.pasts)))


def _ask(
    owner: int,
    call: Callable[[], FetchMapsResponse],
    answers: "queue.SimpleQueue[tuple[int, FetchMapsResponse | Exception]]",
) -> None:
    try:
        answers.put((owner, call()))
    except Exception as error:  # whatever it is: whoever waits must be told
        answers.put((owner, error))
