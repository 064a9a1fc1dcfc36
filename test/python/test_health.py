"""The group `health` of a report, from what core and map nodes have told of themselves."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from rbpf_svgp_slam.msg import FilterStatus, MapStatus
from rbpf_svgp_slam.recorder.health import health
from rbpf_svgp_slam.recorder.recording import Recording
from rbpf_svgp_slam.recorder.refusals import over_lives, refusals


@pytest.mark.parametrize(
    "values, total",
    [
        ([], 0),
        ([0, 2, 2, 5], 5),
        ([3, 3], 3),  # the first status may come late
        ([0, 4, 0, 1, 3], 7),  # begun anew
        ([0, 4, 4, 6], 6),  # remembered
        ([2, 1, 0, 1], 4),  # twice
    ],
)
def test_a_counter_goes_on_where_its_process_begins_anew(values, total):
    assert over_lives(values) == total


def status(refused, **fields):
    return FilterStatus(
        refusal_reasons=list(refused),
        refusal_counts=[count for count, _ in refused.values()],
        refusal_examples=[example for _, example in refused.values()],
        **fields,
    )


def recording(statuses, map_statuses):
    truth = SimpleNamespace(refused={"stamp 0": 2, "frame": 3})
    made = Recording(Path("/run"), None, {}, "", None, truth, statuses=statuses)
    for one in map_statuses:
        made.map_lives[one.node, one.restarts] = one
    return made


# The core dies between the second and the third: it remembers what its filter has refused, and
# not what was refused at the door.
STATUSES = [
    status({}),
    status(
        {
            "odometry/malformed": (2, "a quaternion of zeros"),
            "pings/no_mount": (4, "mbes"),
            "pings/no_odometry": (3, "early"),
        },
        prompts_failed=2,
        journal="kept",
    ),
    status(
        {"pings/no_odometry": (3, "early"), "odometry/malformed": (1, "another")},
        prompts_failed=1,
        prompts_skipped=9,
        prompts_vetoed=1,
        resamplings_failed=1,
        beams_rejected=70,
        resumed=1,
        journal="kept",
    ),
]
# Node 0 has died twice, once before it had said anything.
MAPS = [
    MapStatus(node=0, steps=5, skipped_steps=1),
    MapStatus(node=1, steps=5),
    MapStatus(node=0, restarts=2, steps=2, skipped_steps=2),
    MapStatus(node=0, restarts=2, steps=4, skipped_steps=3),
]


def test_what_was_lost_refused_and_started_again_is_counted_over_all_lives():
    assert health(recording(STATUSES, MAPS), pings_lost=0) == {
        "pings_dropped": 7,
        "refused": {"pings/no_mount": 4, "odometry/malformed": 3, "pings/no_odometry": 3},
        "beams_rejected": 70,
        "ground_truth_refused": 5,
        "prompts_vetoed": 1,
        "prompts_skipped": 9,
        "prompts_failed": 3,
        "resamplings_rolled_back": 1,
        "training_steps_undone": 4,
        "core_resumed": 1,
        "map_nodes_restarted": 2,
        "journal": "kept",
    }


def test_pings_of_the_bag_that_nobody_has_counted_are_lost_too():
    assert health(recording(STATUSES, MAPS), pings_lost=12)["pings_dropped"] == 12


def test_the_first_of_each_reason_is_told_the_most_frequent_before():
    rows = refusals(STATUSES)
    assert list(rows)[0] == "pings/no_mount"
    assert rows["odometry/malformed"] == {"count": 3, "first": "a quaternion of zeros"}


def test_the_latest_status_of_a_node_is_that_of_its_latest_process():
    latest = recording(STATUSES, MAPS).map_statuses
    assert {node: one.steps for node, one in latest.items()} == {0: 4, 1: 5}
