"""A map as bytes: an uncompressed npz file (a zip of npy arrays), readable with numpy.load.

format           'rbpf_svgp_slam/svgp'
version          2; other versions are refused
config           JSON of the settings that the map was trained with (config.py)
iterations       steps taken                        skipped_steps  steps undone
jitter_raises    times that a Cholesky factorisation wanted a larger jitter
reference_m      what is subtracted from every depth; NaN before the first step
averages         [<= window + 1] mature moving averages of the ELBO, nats, oldest first
average_weight   weight gathered by the moving average, 0 .. 1
raw_average      the average times that weight      ready          converged

and what belongs to the optimizer, which its class describes (optimizers/): all that has been
learned. Nothing is pickled, and nothing pickled is ever loaded.
"""

from __future__ import annotations

import io
import json
from typing import Any, Mapping

import numpy as np

from rbpf_svgp_slam.npz import READING_ERRORS
from rbpf_svgp_slam.svgp.config import SvgpConfig

FORMAT = "rbpf_svgp_slam/svgp"
VERSION = 2

#: Name: (kind of number, dimensions), of what every map has.
ENTRIES = {
    "config": ("U", 0),
    "iterations": ("i", 0),
    "skipped_steps": ("i", 0),
    "jitter_raises": ("i", 0),
    "reference_m": ("f", 0),
    "averages": ("f", 1),
    "average_weight": ("f", 0),
    "raw_average": ("f", 0),
    "ready": ("b", 0),
}


def encode(entries: Mapping[str, Any]) -> bytes:
    """Bytes of a state with the names in ENTRIES and those of the map's optimizer."""
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
    expect_entries(entries, ENTRIES)
    return entries


def written_config(entries: Mapping[str, np.ndarray]) -> SvgpConfig:
    """The settings that a decoded state was written under; raises ValueError if they are none."""
    try:
        return SvgpConfig(**json.loads(entries["config"].item()))
    except (TypeError, ValueError) as error:
        raise ValueError(f"map's config is not that of an SVGP ({error})") from error


def expect_entries(
    entries: Mapping[str, np.ndarray], expected: Mapping[str, tuple[str, int]]
) -> None:
    """Raise ValueError where an entry is missing, or of another kind or dimension."""
    for name, (kind, dimensions) in expected.items():
        if name not in entries:
            raise ValueError(f"map has no entry {name}; expected {', '.join(expected)}")
        array = entries[name]
        if array.dtype.kind != kind or array.ndim != dimensions:
            raise ValueError(
                f"map's {name} is {array.dtype}{list(array.shape)}; "
                f"expected kind {kind!r} with {dimensions} dimensions"
            )


def _expect(name: str, value: Any, expected: Any) -> None:
    if str(value) != str(expected):
        raise ValueError(f"map's {name} is {value}; expected {expected}")
