"""Opens a bag, and says which one it is and what to do if it cannot be read."""

from __future__ import annotations

import rosbag


class BagError(RuntimeError):
    """The bag cannot be read; the message names it."""


def open_bag(path: str) -> rosbag.Bag:
    """For reading. Raises BagError."""
    try:
        return rosbag.Bag(path)
    except rosbag.ROSBagUnindexedException as error:
        raise BagError(
            f"{path} has no index, as if its recording was cut off; rosbag reindex may mend it"
        ) from error
    except (rosbag.ROSBagException, OSError) as error:
        raise BagError(f"{path} cannot be read: {error}") from error
