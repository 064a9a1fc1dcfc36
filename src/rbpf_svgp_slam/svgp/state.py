"""A map as bytes: an uncompressed npz file (a zip of npy arrays), readable with numpy.load.

format           'rbpf_svgp_slam/svgp'
version          1; other versions are refused
config           JSON of the settings that the map was trained with (config.py)
iterations       steps taken                        skipped_steps  steps undone
jitter_raises    times that a Cholesky factorisation wanted a larger jitter
reference_m      what is subtracted from every depth; NaN before the first step
parameters       [P] m [S], R [S, S] by rows up to the diagonal, Z [S, 2], raw ℓ, o, σ² and c
adam_steps       steps that Adam counts, and its two moments, in the order of `parameters`:
adam_first       [P]                                adam_second    [P]
averages         [<= window + 1] mature moving averages of the ELBO, nats, oldest first
average_weight   weight gathered by the moving average, 0 .. 1
raw_average      the average times that weight      ready          converged

P = S + S(S + 1)/2 + 2S + 4. Nothing is pickled, and nothing pickled is ever loaded.
"""

from __future__ import annotations

import io
import zipfile
import zlib
from typing import Any, Mapping

import numpy as np

FORMAT = "rbpf_svgp_slam/svgp"
VERSION = 1

#: Name: (kind of number, dimensions).
ENTRIES = {
    "config": ("U", 0),
    "iterations": ("i", 0),
    "skipped_steps": ("i", 0),
    "jitter_raises": ("i", 0),
    "reference_m": ("f", 0),
    "parameters": ("f", 1),
    "adam_steps": ("i", 0),
    "adam_first": ("f", 1),
    "adam_second": ("f", 1),
    "averages": ("f", 1),
    "average_weight": ("f", 0),
    "raw_average": ("f", 0),
    "ready": ("b", 0),
}

#: What numpy and zipfile raise at bytes that are no npz file or a damaged one.
READING_ERRORS = (
    AttributeError,
    EOFError,
    KeyError,
    OSError,
    RuntimeError,
    ValueError,
    zipfile.BadZipFile,
    zlib.error,
)


def encode(entries: Mapping[str, Any]) -> bytes:
    """Bytes of a state with exactly the names in ENTRIES."""
    buffer = io.BytesIO()
    np.savez(buffer, format=FORMAT, version=VERSION, **entries)
    return buffer.getvalue()


def decode(data: bytes) -> dict[str, np.ndarray]:
    """Entries of a state; raises ValueError if the bytes are anything else."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            entries = {name: archive[name] for name in archive.files}
    except READING_ERRORS as error:
        raise ValueError(
            f"map of {len(data)} bytes is truncated or no npz file ({error}); expected {FORMAT}"
        ) from error
    _expect("format", entries.get("format", "missing"), FORMAT)
    _expect("version", entries.get("version", "missing"), VERSION)
    for name, (kind, dimensions) in ENTRIES.items():
        if name not in entries:
            raise ValueError(f"map has no entry {name}; expected {', '.join(ENTRIES)}")
        array = entries[name]
        if array.dtype.kind != kind or array.ndim != dimensions:
            raise ValueError(
                f"map's {name} is {array.dtype}{list(array.shape)}; "
                f"expected kind {kind!r} with {dimensions} dimensions"
            )
    return entries


def _expect(name: str, value: Any, expected: Any) -> None:
    if str(value) != str(expected):
        raise ValueError(f"map's {name} is {value}; expected {expected}")
