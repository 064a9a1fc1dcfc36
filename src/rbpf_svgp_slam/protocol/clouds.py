"""Point clouds for RViz and for whoever wants the map live."""

from __future__ import annotations

import numpy as np
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header


def packed_rgb(rgb: np.ndarray) -> np.ndarray:
    """Return uint8 colours [n, 3] as a float32 column [n] `rgb`, as PCL and RViz have it."""
    red, green, blue = (rgb[:, i].astype("<u4") for i in range(3))
    return (red << 16 | green << 8 | blue).view("<f4")


def cloud_xy(cloud: PointCloud2) -> np.ndarray:
    """x and y [n, 2] of a cloud with float32 fields x and y, little-endian."""
    offset_of = {field.name: field.offset for field in cloud.fields}
    layout = {
        "names": ["x", "y"],
        "formats": ["<f4", "<f4"],
        "offsets": [offset_of["x"], offset_of["y"]],
        "itemsize": cloud.point_step,
    }
    points = np.frombuffer(cloud.data, dtype=np.dtype(layout))
    return np.column_stack([points["x"], points["y"]])


def point_cloud(header: Header, columns: dict[str, np.ndarray]) -> PointCloud2:
    """An unorganised cloud of float32 fields, in the order of the columns, each [n]."""
    names = list(columns)
    data = np.stack([np.asarray(columns[name], dtype="<f4") for name in names], axis=1)
    fields = [
        PointField(name=name, offset=4 * i, datatype=PointField.FLOAT32, count=1)
        for i, name in enumerate(names)
    ]
    return PointCloud2(
        header=header,
        height=1,
        width=len(data),
        fields=fields,
        is_bigendian=False,
        point_step=4 * len(names),
        row_step=4 * len(names) * len(data),
        data=data.tobytes(),
        is_dense=bool(np.isfinite(data).all()),
    )
