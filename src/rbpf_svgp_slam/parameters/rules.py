"""What a parameter's value must be."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Callable


@dataclass(frozen=True)
class Rule:
    """An expectation, for the reader and for the machine."""

    expected: str
    accepts: Callable[[Any], bool]
    convert: Callable[[Any], Any] = lambda value: value


def integer(least: int, most: float = math.inf) -> Rule:
    """An integer in [least, most]."""
    return Rule(
        f"an integer of at least {least}"
        if most == math.inf
        else f"an integer in {least} .. {most}",
        lambda value: _is_integer(value) and least <= value <= most,
    )


def at_least(least: float) -> Rule:
    """A finite number in [least, inf)."""
    expected = f"a number of at least {least:g}"
    return Rule(expected, lambda value: _is_number(value) and value >= least, float)


def positive() -> Rule:
    """A finite number in (0, inf)."""
    return Rule("a number above 0", lambda value: _is_number(value) and value > 0, float)


def choice(*options: str) -> Rule:
    """One of some names."""
    return Rule(f"one of {', '.join(options)}", lambda value: value in options)


def group() -> Rule:
    """A group of parameters."""
    return Rule("a group of parameters", lambda value: isinstance(value, dict))


def name() -> Rule:
    """A text that is not empty."""
    return Rule("a name", lambda value: isinstance(value, str) and bool(value))


def polygon() -> Rule:
    """Vertices [[x, y], ...] that enclose an area; becomes a tuple of pairs."""
    return Rule(
        "a polygon [[x, y], ...] of at least 3 finite vertices in map, m, that encloses an area",
        _is_polygon,
        lambda value: tuple((float(x), float(y)) for x, y in value),
    )


def _is_integer(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _is_number(value: Any) -> bool:
    return _is_integer(value) or (isinstance(value, float) and math.isfinite(value))


def _is_polygon(value: Any) -> bool:
    if not isinstance(value, list) or len(value) < 3:
        return False
    for vertex in value:
        if not isinstance(vertex, list) or len(vertex) != 2 or not all(map(_is_number, vertex)):
            return False
    following = value[1:] + value[:1]
    # Shoelace formula.
    return sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in zip(value, following)) != 0
