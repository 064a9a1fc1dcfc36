"""Messages between a benchmark and its workers: dictionaries of arrays, as npz, length first.

Pickles would not do: those of numpy 2 cannot be read by numpy 1.
"""

from __future__ import annotations

import io
import struct
from typing import Any, BinaryIO

import numpy as np

_LENGTH = struct.Struct("<Q")


def send(stream: BinaryIO, message: dict[str, Any]) -> None:
    """Write a message of arrays, numbers and strings."""
    buffer = io.BytesIO()
    np.savez(buffer, **message)
    stream.write(_LENGTH.pack(buffer.tell()))
    stream.write(buffer.getvalue())
    stream.flush()


def receive(stream: BinaryIO) -> dict[str, np.ndarray] | None:
    """Read a message; None when the other side has closed."""
    head = stream.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        return None
    data = stream.read(*_LENGTH.unpack(head))
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        return dict(arrays)
