"""Which topic of a bag is meant by a name."""

import pytest

from rbpf_svgp_slam.bags.topics import TopicError, topic_in_bag

TOPICS = ["/odom", "/mbes/pings", "/auv/nav/odom", "scan"]


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("/odom", "/odom"),
        ("odom", "/odom"),
        ("/mbes/pings", "/mbes/pings"),
        ("mbes/pings", "/mbes/pings"),
        ("/auv/odom", "/odom"),  # a launch file's namespace before a bag's own name
        ("/auv/nav/odom", "/auv/nav/odom"),  # the longest name that fits
        ("/nav/odom", "/odom"),
        ("/scan", "scan"),
    ],
)
def test_a_topic_is_found_with_or_without_slash_and_namespace(name, expected):
    assert topic_in_bag(name, TOPICS, "odometry", "f.bag") == expected


@pytest.mark.parametrize("name", ["/pings", "/mbes", "/", ""])
def test_a_topic_that_the_bag_lacks_is_named_with_those_it_has(name):
    with pytest.raises(TopicError) as error:
        topic_in_bag(name, TOPICS, "pings", "f.bag")
    for part in ("f.bag", f"topic {name} for the pings", *TOPICS):
        assert part in str(error.value)


def test_an_empty_bag_has_no_topics():
    with pytest.raises(TopicError, match="its topics are none"):
        topic_in_bag("/odom", [], "odometry", "f.bag")
