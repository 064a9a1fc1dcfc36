"""What a case is expected to come to."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Callable, Mapping

from bag_cases.survey import Survey


@dataclass(frozen=True)
class Expected:
    """The end of a run, offline or live."""

    #: Regular expression of the last lines, where the run has to end without a report.
    stops: str = ""
    #: Reasons of refusals. Together they must count the messages that the case has spoilt.
    refused: tuple[str, ...] = ()
    #: No: what is spoilt costs others, too.
    counts_are_known: bool = True
    #: Names of findings that the report must hold; no others may be there.
    finds: tuple[str, ...] = ()
    #: Further values in the report.
    report: Mapping[str, Any] = field(default_factory=dict)
    #: The report knows the true track.
    has_truth: bool = True
    #: The track that comes out is near the true one.
    is_near: bool = True

    def __str__(self) -> str:
        if self.stops:
            return "stops and says why"
        words = [*self.refused, *self.finds]
        return "right" + (": " + ", ".join(words) if words else "")


RIGHT = Expected()


def refused(*reasons: str) -> Expected:
    return Expected(refused=reasons)


def stops(*words: str) -> Expected:
    """The words, regular expressions, must come in this order, on whatever lines."""
    return Expected(stops=r"[\s\S]*".join(f"(?:{word})" for word in words))


def finds(*names: str, is_near: bool = True) -> Expected:
    return Expected(finds=names, is_near=is_near)


@dataclass(frozen=True)
class Case:
    name: str
    kind: str
    comes_in: str
    make: Callable[[Survey], Survey]
    offline: Expected
    #: None: as offline.
    live_if_other: Expected | None = None
    #: Why it is not tried live.
    not_live: str = ""

    @property
    def live(self) -> Expected:
        return self.live_if_other or self.offline
