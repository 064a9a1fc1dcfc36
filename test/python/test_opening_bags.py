"""What is said of bags that cannot be read."""

import pytest
import rosbag
from std_msgs.msg import String

from rbpf_svgp_slam.bags.opening import BagError, open_bag


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "some.bag"
    with rosbag.Bag(str(path), "w") as bag:
        bag.write("/said", String("something"))
    return path


def test_a_whole_bag_is_opened(path):
    with open_bag(str(path)) as bag:
        assert bag.get_message_count() == 1


def test_one_that_was_cut_off_may_be_mended(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
    with pytest.raises(BagError, match="some.bag has no index.*rosbag reindex"):
        open_bag(str(path))


@pytest.mark.parametrize("content", [None, b"", b"no bag\n"])
def test_another_file_or_none_is_named(path, content):
    path.unlink()
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(BagError, match="some.bag cannot be read: ."):
        open_bag(str(path))
