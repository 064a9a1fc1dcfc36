"""Tables of a run folder, in columns named as the fields of a message."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import MISSING, dataclass, fields
from typing import Any, ClassVar, TypeVar

import numpy as np

_Self = TypeVar("_Self", bound="Columns")


@dataclass
class Columns:
    """The first column of each kind says how many rows there are."""

    #: Of each column: what its elements are, and the shape of one row's.
    KINDS: ClassVar[dict[str, tuple[type, tuple[int, ...]]]]

    def __post_init__(self) -> None:
        for name, (_, shape) in self.KINDS.items():
            expected, got = (len(self), *shape), np.shape(getattr(self, name))
            if got != expected:
                kind = type(self).__name__.lower()
                raise ValueError(f"{kind}' {name}: expected shape {expected}, got {got}")

    def __len__(self) -> int:
        return len(getattr(self, next(iter(self.KINDS))))

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Of all columns."""
        return tuple(cls.KINDS)

    @classmethod
    def needed(cls) -> tuple[str, ...]:
        """Of the columns that cannot be done without."""
        return tuple(one.name for one in fields(cls) if one.default is MISSING)

    @classmethod
    def of(cls: type[_Self], rows: Iterable[Any]) -> _Self:
        """From objects with these attributes, as messages are."""
        rows = list(rows)
        return cls(
            **{
                name: np.array([getattr(row, name) for row in rows], dtype).reshape(-1, *shape)
                for name, (dtype, shape) in cls.KINDS.items()
            }
        )

    def rows(self) -> list[dict[str, Any]]:
        """A dictionary for each row."""
        return [dict(zip(self.KINDS, row)) for row in zip(*(getattr(self, n) for n in self.KINDS))]
