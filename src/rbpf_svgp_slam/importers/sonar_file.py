"""A sonar's file as bytes: read in place, and every mistake is told by its offset."""

from __future__ import annotations

import mmap
import struct
from pathlib import Path
from typing import Any

import numpy as np


class ImportProblem(ValueError):
    """A mistake in a file or in what was asked for; the message names it and what was expected."""


class SonarFileError(ImportProblem):
    """What is wrong with a file: its name, the offset, what is there, what was expected."""

    def __init__(self, path: Path, offset: int, found: str, expected: str) -> None:
        super().__init__(f"{path}: at byte {offset}: {found}, expected {expected}")


class SonarFile:
    """The bytes of a file. All reads raise SonarFileError where they would leave it."""

    def __init__(self, path: Path) -> None:
        """Raises SonarFileError if there is nothing to read, OSError if it cannot be."""
        self.path = path
        if path.is_dir():
            raise SonarFileError(path, 0, "a folder", "a file of a sonar")
        with path.open("rb") as file:
            if not path.stat().st_size:
                raise SonarFileError(path, 0, "an empty file", "a file of a sonar")
            self.data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)

    def __len__(self) -> int:
        return len(self.data)

    def error(self, offset: int, found: str, expected: str) -> SonarFileError:
        """To be raised."""
        return SonarFileError(self.path, offset, found, expected)

    def unpack(self, format_: str, offset: int, what: str) -> tuple[Any, ...]:
        """Values as struct has them; what: their name, for the message."""
        size = struct.calcsize(format_)
        self.need(offset, size, what)
        return struct.unpack_from(format_, self.data, offset)

    def array(self, dtype: Any, count: int, offset: int, what: str) -> np.ndarray:
        """An array [count] that looks at the file's bytes."""
        dtype = np.dtype(dtype)
        self.need(offset, count * dtype.itemsize, what)
        return np.frombuffer(self.data, dtype, count, offset)

    def bytes(self, offset: int, size: int, what: str) -> bytes:
        """A copy."""
        self.need(offset, size, what)
        return self.data[offset : offset + size]

    def need(self, offset: int, size: int, what: str) -> None:
        """Raises SonarFileError unless so many bytes are there."""
        there = len(self.data) - offset
        if size < 0 or there < size:
            raise self.error(offset, f"{max(there, 0)} bytes left", f"{size} bytes of {what}")
