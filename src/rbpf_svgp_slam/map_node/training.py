"""What a map node does when nobody asks it for anything: train its maps."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Callable

import rospy

from rbpf_svgp_slam.map_node.core_client import Feed, MinibatchFeed, Minibatches
from rbpf_svgp_slam.map_node.map_store import MapStore
from rbpf_svgp_slam.map_node.resampling_phases import RETRY_S
from rbpf_svgp_slam.map_node.turns import EndTurn, TurnFeed
from rbpf_svgp_slam.maps import MapGroup

# Longest wait for minibatches, after which the node looks after its other duties.
IDLE_S = 0.1
ERROR_PERIOD_S = 10.0


class Training(ABC):
    """Answers of the core under this node's epoch, and what is done with them."""

    def __init__(self, store: MapStore, feed: Feed, between_steps: Callable[[], None]) -> None:
        """between_steps: called where others may work."""
        self._store = store
        self._feed = feed
        self._between_steps = between_steps
        self._decision_asked = False  # of a resampling whose decision is overdue

    def advance(self) -> None:
        """A piece of training, or a short wait."""
        minibatches = self._next_minibatches()
        if minibatches is not None:
            self._train(minibatches)

    def stop(self) -> None:
        """Ask the core for no more."""
        self._feed.stop()

    @abstractmethod
    def _train(self, minibatches: Minibatches) -> None:
        """Use one reply of the core."""

    def _attempt(self, what: str, step: Callable[[], bool], if_it_fails: bool = True) -> bool:
        """A step of one map, whose failure must not stop the others; false: the epoch is over."""
        goes_on = if_it_fails
        try:
            goes_on = step()
        except Exception as error:
            rospy.logerr_throttle(ERROR_PERIOD_S, f"{what} failed: {error!r}")
        self._between_steps()
        return goes_on and not self._store.superseded and not rospy.is_shutdown()

    def _next_minibatches(self) -> Minibatches | None:
        """Minibatches of this node's epoch, if there are any at present."""
        if not self._store.frozen:
            reply = self._feed.take(IDLE_S)
            return reply if reply is not None and self._is_current(reply) else None
        if self._store.undecided():
            self._ask_for_decision()
        else:
            self._store.wait_while_frozen(IDLE_S)
        return None

    def _ask_for_decision(self) -> None:
        """Learn from the core how a resampling has ended, if its decision is late or lost."""
        # Only an answer to a question asked from now on tells.
        if not self._decision_asked:
            self._feed.refresh()
            self._decision_asked = True
        reply = self._feed.take(RETRY_S)
        if reply is None:
            return
        self._decision_asked = False
        done = self._store.settle(reply.epoch, reply.resampling)
        if done:
            rospy.logwarn("a resampling's outcome has not been sent; %s, as the core says", done)

    def _is_current(self, reply: Minibatches) -> bool:
        """Whether a reply is of this node's epoch; beams placed under another one are of no use.

        If the core has settled for another epoch, the node adopts it.
        """
        if not self._store.hear_survey(reply.survey):
            return False
        epoch = self._store.epoch
        if reply.epoch == epoch:
            return True
        if reply.asked_epoch != epoch:
            # The replies behind it were asked for under the old epoch too.
            self._feed.refresh()
            return False
        if reply.resampling or self._store.frozen:
            return False
        if self._store.steps == 0:
            rospy.loginfo("joining at epoch %d, with new maps", reply.epoch)
        else:
            rospy.logerr_throttle(
                ERROR_PERIOD_S,
                f"the core is at epoch {reply.epoch}; expected {epoch}, this node's: "
                "a resampling has been missed, the maps stay as they are",
            )
        self._store.adopt(reply.epoch)
        return False


class MinibatchTraining(Training):
    """Every map learns from minibatches of its own: a *round* is one for each map of the node."""

    def __init__(
        self,
        store: MapStore,
        group: MapGroup,
        between_steps: Callable[[], None],
        end_turn: EndTurn | None = None,
    ) -> None:
        """end_turn: none if live; under an offline replay, tells the node's state (turns.py)."""
        request = (lambda: store.own, group.minibatch_size, lambda: store.epoch)
        feed: Feed
        if end_turn is None:
            feed = MinibatchFeed(*request)
        else:
            feed = TurnFeed(*request, per_round=len(store.own), end_turn=end_turn)
        super().__init__(store, feed, between_steps)

    def _train(self, minibatches: Minibatches) -> None:
        epoch, N = minibatches.epoch, minibatches.beams_in_log
        # Such maps need not do more for it than to learn on.
        self._store.follow_at_once(minibatches.past)
        for particle, beams in zip(self._store.own, minibatches.beams):
            if not self._attempt(
                f"training step of particle {particle}",
                lambda: self._store.train(particle, epoch, beams, N),
            ):
                return
