"""Cases of several kinds in one bag."""

from __future__ import annotations

from bag_cases import clocks, formats, geometry, mounts, names, recordings, truths, twists
from bag_cases.expected import Case, Expected, refused
from bag_cases.survey import Survey


def harmless(survey: Survey) -> Survey:
    """What costs no more than the messages that are wrong, and some that look wrong and are not."""
    for step in (
        formats.some_all_nan,
        formats.mixed,
        names.slashed_frames,
        truths.pose_stamped,
        geometry.area_closed_ring,
        clocks.one_ping_twenty_times,
        clocks.one_odometry_moved(clocks.HOUR_S),
        twists.some_of_speed(1e6),
    ):
        survey = step(survey)
    return survey


def unusual(survey: Survey) -> Survey:
    """What is rare and right, and ground truth that cannot be used."""
    for step in (
        formats.laser_scans,
        mounts.mount_on_tf,
        geometry.utm,
        names.odometry_in_map,
        truths.of_a_wrong_type,
        recordings.pause_in_recording,
        clocks.one_of_each_beyond_2038,
    ):
        survey = step(survey)
    return survey


CASES = [
    Case(
        "harmless_together",
        "together",
        "mixed formats, slashes, 10 pings of NaN, one ping 20 times, one message an hour ahead, "
        "5 of 10⁶ m/s",
        harmless,
        refused(
            "pings/no_beams",
            "pings/duplicate_stamp",
            "odometry/clock_ahead",
            "odometry/implausible_twist",
        ),
    ),
    Case(
        "unusual_together",
        "together",
        "LaserScan, the mount on /tf, UTM, odometry in map, ground truth of a wrong type, a pause, "
        "one message and one ping beyond 2³¹ s",
        unusual,
        Expected(refused=("odometry/clock_ahead", "pings/clock_ahead"), has_truth=False),
    ),
]
