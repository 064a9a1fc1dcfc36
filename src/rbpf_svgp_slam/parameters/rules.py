"""What a parameter's value must be, and the one wording in which it is told what was expected."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Callable, Tuple

#: Vertices (x, y), frame map, m.
Polygon = Tuple[Tuple[float, float], ...]
#: Stands for the value of a parameter that is not set.
MISSING = object()
#: Of a polygon.
MOST_VERTICES = 10_000


class ParameterError(ValueError):
    """A parameter is unknown, missing, of the wrong type or out of range."""


@dataclass(frozen=True)
class Rule:
    """An expectation, for the reader and for the machine."""

    expected: str
    accepts: Callable[[Any], bool]
    convert: Callable[[Any], Any] = lambda value: value
    first: "Rule | None" = None  # where this is broken already, it is told instead

    def unmet(self, value: Any) -> str:
        """What was expected of a value that is refused; empty if it is accepted."""
        before = self.first.unmet(value) if self.first else ""
        return before or ("" if self.accepts(value) else self.expected)


def checked(name: str, value: Any, rule: Rule) -> Any:
    """The value as its rule converts it; raises ParameterError."""
    if value is MISSING:
        raise ParameterError(f"{name} is not set; expected {rule.expected}")
    expected = rule.unmet(value)
    if expected:
        raise ParameterError(f"{name} is {value!r}; expected {expected}{_hint(value)}")
    return rule.convert(value)


def integer(least: int, most: int) -> Rule:
    """An integer in [least, most]."""
    return Rule(
        f"an integer in {least} .. {most}",
        lambda value: _is_integer(value) and least <= value <= most,
    )


def between(least: float, most: float) -> Rule:
    """A number in [least, most]."""
    expected = f"a number from {least:g} to {most:g}"
    return Rule(expected, lambda value: _is_number(value) and least <= value <= most, float)


def positive() -> Rule:
    """A finite number in (0, inf)."""
    return Rule("a number above 0", lambda value: _is_number(value) and value > 0, float)


def of_type(kind: type) -> Rule:
    """A value of just this type; a whole number is a good float."""
    kinds = (float, int) if kind is float else (kind,)
    return Rule(f"a value of type {kind.__name__}", lambda value: type(value) in kinds, kind)


def finite() -> Rule:
    """A number, neither infinite nor NaN."""
    return Rule("a finite number", math.isfinite, float, first=of_type(float))


def choice(*options: str) -> Rule:
    """One of some names."""
    return Rule(f"one of {', '.join(options)}", lambda value: value in options)


def group() -> Rule:
    """A group of parameters."""
    return Rule("a group of parameters", lambda value: isinstance(value, dict))


def name(expected: str = "a name") -> Rule:
    """A text that is not empty."""
    return Rule(expected, lambda value: isinstance(value, str) and bool(value))


def absolute_path(what: str) -> Rule:
    """A path from / or from ~: a node's working folder is not the one that it was started from."""
    return Rule(
        f"the absolute path {what}",
        lambda value: isinstance(value, str) and value.startswith(("/", "~")),
    )


def polygon() -> Rule:
    """Vertices [[x, y], ...] that enclose an area; becomes a tuple of pairs."""
    return Rule(
        f"a polygon [[x, y], ...] of 3 to {MOST_VERTICES} finite vertices in map, m, that encloses "
        "an area",
        _is_polygon,
        lambda value: tuple((float(x), float(y)) for x, y in value),
    )


def place() -> Rule:
    """[latitude, longitude] or []; becomes a tuple."""
    return Rule(
        "[latitude, longitude] in degrees within +-90 and +-360, or []",
        _is_place,
        lambda value: tuple(map(float, value)),
    )


def epsg_code() -> Rule:
    """An EPSG code as far as its number tells, or 0."""
    return integer(0, 999_999)


def _is_integer(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _is_number(value: Any) -> bool:
    return _is_integer(value) or (isinstance(value, float) and math.isfinite(value))


def _is_polygon(value: Any) -> bool:
    if not isinstance(value, list) or not 3 <= len(value) <= MOST_VERTICES:
        return False
    for vertex in value:
        if not isinstance(vertex, list) or len(vertex) != 2 or not all(map(_is_number, vertex)):
            return False
    following = value[1:] + value[:1]
    # Shoelace formula.
    return sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in zip(value, following)) != 0


def _is_place(value: Any) -> bool:
    if not isinstance(value, list) or not all(map(_is_number, value)):
        return False
    return not value or (len(value) == 2 and abs(value[0]) <= 90 and abs(value[1]) <= 360)


def _hint(value: Any) -> str:
    """YAML 1.1 takes 1e-4 for text."""
    try:
        float(value if isinstance(value, str) else "")
    except ValueError:
        return ""
    return "; this is text: in YAML write 1.0e-4, not 1e-4, and no quotes"
