"""Arrays on the wire: float32, little-endian, row-major, as the bytes of a uint8[] field."""

from __future__ import annotations

import math

import numpy as np


class BadRequest(ValueError):
    """A request that cannot be served; the message names thing, value and expectation."""


def pack(array: np.ndarray) -> bytes:
    """The bytes of an array of any shape."""
    return np.ascontiguousarray(array, dtype="<f4").tobytes()


def unpack(name: str, data: bytes, shape: tuple[int, ...]) -> np.ndarray:
    """A writable float32 array of the given shape, every element finite."""
    expected = f"float32 {list(shape)}"
    array = _array(name, data, np.dtype("<f4"), shape, expected).astype(np.float32)
    if not np.isfinite(array).all():
        first = np.argwhere(~np.isfinite(array))[0].tolist()
        raise BadRequest(f"{name}{first} is {array[tuple(first)]}; expected finite values only")
    return array


def unpack_records(name: str, data: bytes, dtype: np.dtype, shape: tuple[int, ...]) -> np.ndarray:
    """A read-only array of records of numbers, of the given shape, every number finite."""
    array = _array(name, data, dtype, shape, f"{list(shape)} of {dtype.itemsize} bytes")
    for field in dtype.names:
        if not np.isfinite(array[field]).all():
            raise BadRequest(f"{name} has a {field} that is not finite; expected finite only")
    return array


def _array(
    name: str, data: bytes, dtype: np.dtype, shape: tuple[int, ...], expected: str
) -> np.ndarray:
    expected_bytes = dtype.itemsize * math.prod(shape)
    if len(data) != expected_bytes:
        raise BadRequest(f"{name} has {len(data)} bytes; expected {expected_bytes}: {expected}")
    return np.frombuffer(data, dtype=dtype).reshape(shape)


def split(name: str, data: bytes, sizes: list[int]) -> list[bytes]:
    """Pieces of the given sizes, which together make up the data."""
    if sum(sizes) != len(data):
        raise BadRequest(
            f"{name} has {len(data)} bytes; expected {sum(sizes)}, the sum of its sizes"
        )
    ends = np.cumsum(sizes, dtype=int)
    return [bytes(data[end - size : end]) for size, end in zip(sizes, ends)]
