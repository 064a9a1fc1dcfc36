"""Beams of a PointCloud2, and clouds of beams laid out as drivers lay them out."""

from __future__ import annotations

import numpy as np
from sensor_msgs.msg import PointCloud2, PointField

NUMBER_TYPES = {"f4": PointField.FLOAT32, "f8": PointField.FLOAT64}


def beams(message: PointCloud2) -> np.ndarray:
    """The points [N, 3] of a simulated ping: packed float32."""
    return np.frombuffer(message.data, "<f4").reshape(-1, 3)


def cloud(
    message: PointCloud2,
    points: np.ndarray,
    dtype: str = "<f4",
    extra_bytes: int = 0,
    rows: int = 1,
    row_padding: int = 0,
) -> PointCloud2:
    """The message with other points [N, 3], N a multiple of rows.

    dtype: <f4, <f8 or big-endian >f4, >f8; extra_bytes: of each point, after x y z;
    row_padding: bytes at the end of each row.
    """
    size = np.dtype(dtype).itemsize
    step = 3 * size + extra_bytes
    raw = np.full((len(points), step), 0xAB, np.uint8)
    raw[:, : 3 * size] = np.ascontiguousarray(points.astype(dtype)).view(np.uint8)
    table = raw.reshape(rows, -1)
    padded = np.hstack([table, np.full((rows, row_padding), 0xCD, np.uint8)])
    number = NUMBER_TYPES[dtype[1:]]
    fields = [PointField(name, i * size, number, 1) for i, name in enumerate("xyz")]
    if extra_bytes:
        fields.append(PointField("quality", 3 * size, PointField.UINT8, 1))
    return PointCloud2(
        header=message.header,
        height=rows,
        width=len(points) // rows,
        fields=fields,
        is_bigendian=dtype.startswith(">"),
        point_step=step,
        row_step=padded.shape[1],
        data=padded.tobytes(),
        is_dense=bool(np.isfinite(points).all()),
    )


def filled(points: np.ndarray, size: int) -> np.ndarray:
    """The points with NaN up to a fixed size, as drivers fill lost beams."""
    full = np.full((size, 3), np.nan, "f4")
    full[: len(points)] = points
    return full
