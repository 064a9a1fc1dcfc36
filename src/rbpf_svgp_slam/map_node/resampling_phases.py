"""Where a map node stands in the two phases of a resampling; free of ROS, and of the maps."""

from __future__ import annotations

import math
import threading
import time
from dataclasses import dataclass
from typing import Any, Callable

from rbpf_svgp_slam.protocol.payload import BadRequest

# After a failed preparation, and between two questions whether the core has decided.
RETRY_S = 1.0
# What `settle` has done.
COMMITTED, ABORTED, NOTHING = "committed", "aborted", ""


@dataclass
class Attempt:
    """One attempt to prepare a resampling, from freezing to the core's decision."""

    epoch: int  # that the resampling leads to
    prepared: Any = None  # what a commit takes over; none before the preparation has succeeded
    ask_at_s: float = math.inf  # monotonic; the core is asked for its decision from then on


class ResamplingPhases:
    """The node's epoch, and how far the resampling under way has come.

    The *epoch* counts the resamplings that have been committed; the core's number tells under
    which particles a message was written. A resampling has two phases. In the first the core sends
    every node the plan: the node freezes, which is to stop training, prepares what it will go on
    with, and reports. In the second the core tells all nodes to commit, or, where one has failed,
    to abort. A decision that never comes is read from the core's own epoch (`settle`).

        training ── freeze ─► frozen ── finish_preparation ─► prepared ── commit ─► training
                                └────────── abort ───────────────┴───── abort ────► training

    Methods may be called from different threads.
    """

    def __init__(self, take_over: Callable[[Any], None]) -> None:
        """take_over: called on a commit with what was prepared, before training goes on."""
        self.epoch = 0
        self._take_over = take_over
        self._attempt: Attempt | None = None
        self._changed = threading.Condition()

    @property
    def frozen(self) -> bool:
        """No training: a resampling is under way."""
        return self._attempt is not None

    def allows_training(self, epoch: int) -> bool:
        """Beams of that epoch may be used now."""
        return self._attempt is None and epoch == self.epoch

    def is_frozen_for(self, epoch: int) -> bool:
        """Training has stopped for the resampling that leads to that epoch."""
        return self._attempt is not None and self._attempt.epoch == epoch

    def wait_while_frozen(self, timeout_s: float) -> None:
        """Until the resampling under way is decided, if it is within the timeout."""
        with self._changed:
            self._changed.wait_for(lambda: self._attempt is None, timeout_s)

    def wait_until_frozen_for(self, epoch: int, timeout_s: float) -> None:
        """Raises BadRequest if training has not stopped for that epoch within the timeout."""
        with self._changed:
            if epoch != self.epoch + 1:
                raise BadRequest(f"epoch is {epoch}; expected {self.epoch} or {self.epoch + 1}")
            if not self._changed.wait_for(lambda: self.is_frozen_for(epoch), timeout_s):
                raise BadRequest(
                    f"this node has not stopped training for epoch {epoch} within {timeout_s:g} s; "
                    "expected its part of the resampling to be prepared"
                )

    def adopt(self, epoch: int) -> None:
        """Take over the core's epoch as it is."""
        with self._changed:
            self.epoch = epoch
            self._resume_training()

    # First phase

    def expect_next(self, epoch: int) -> None:
        """Raises BadRequest unless a resampling to that epoch is the next one."""
        if epoch != self.epoch + 1:
            raise BadRequest(f"epoch is {epoch}; expected {self.epoch + 1}, this node's + 1")

    def freeze(self, epoch: int) -> Attempt:
        """Stop training for the resampling to that epoch."""
        with self._changed:
            self.expect_next(epoch)
            # A second plan for an epoch replaces the first, whose abort must have been lost.
            self._attempt = Attempt(epoch)
            self._changed.notify_all()
            return self._attempt

    def finish_preparation(self, attempt: Attempt, prepared: Any, timeout_s: float) -> None:
        """Everything is ready for a commit; without a decision in time, `undecided` turns true.

        Raises BadRequest if the attempt has been aborted or replaced meanwhile.
        """
        with self._changed:
            if self._attempt is not attempt:
                raise BadRequest(
                    f"resampling to epoch {attempt.epoch} ended while its maps were being fetched; "
                    "expected it to wait for this node"
                )
            attempt.prepared = prepared
            attempt.ask_at_s = time.monotonic() + timeout_s

    def fail_preparation(self, attempt: Attempt) -> None:
        """Stay frozen until the core aborts: other nodes may still be fetching maps from here."""
        attempt.ask_at_s = time.monotonic() + RETRY_S

    # Second phase

    def commit(self, epoch: int) -> None:
        """Take over what was prepared, and train on. Repeating it changes nothing."""
        with self._changed:
            if epoch == self.epoch:
                return
            attempt = self._attempt
            if attempt is None or attempt.epoch != epoch or attempt.prepared is None:
                raise BadRequest(f"epoch is {epoch}; expected {self._expected_decision()}")
            self._commit(attempt)

    def abort(self, epoch: int) -> None:
        """Drop what was prepared, and train on. Repeating it changes nothing."""
        with self._changed:
            if epoch != self.epoch + 1:
                raise BadRequest(f"epoch is {epoch}; expected {self.epoch + 1}, not yet committed")
            self._resume_training()

    def undecided(self) -> bool:
        """The decision is overdue: the core must be asked."""
        attempt = self._attempt
        return attempt is not None and time.monotonic() >= attempt.ask_at_s

    def settle(self, core_epoch: int, core_resampling: bool) -> str:
        """Where the decision is overdue, act on the core's own state; returns what was done.

        core_resampling: the core has not decided yet.
        """
        with self._changed:
            attempt = self._attempt
            if attempt is None or not self.undecided():
                return NOTHING
            if core_epoch == attempt.epoch and attempt.prepared is not None:
                self._commit(attempt)
                return COMMITTED
            if core_resampling:
                attempt.ask_at_s = time.monotonic() + RETRY_S
                return NOTHING
            self._resume_training()
            return ABORTED

    # Helpers, all called with `_changed` held

    def _commit(self, attempt: Attempt) -> None:
        self._take_over(attempt.prepared)
        self.epoch = attempt.epoch
        self._resume_training()

    def _resume_training(self) -> None:
        self._attempt = None
        self._changed.notify_all()

    def _expected_decision(self) -> str:
        if self._attempt is None:
            return f"{self.epoch}, nothing is prepared"
        if self._attempt.prepared is None:
            return f"{self.epoch}, epoch {self._attempt.epoch} is not fully prepared"
        return f"{self._attempt.epoch}, as prepared"
