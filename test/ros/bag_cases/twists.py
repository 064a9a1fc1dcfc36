"""Odometry whose twist does not fit its pose, or no vehicle."""

from __future__ import annotations

import math
from typing import Callable

from nav_msgs.msg import Odometry
from scipy.spatial.transform import Rotation

from bag_cases.expected import Case, Expected, finds, refused, stops
from bag_cases.survey import ODOMETRY, Survey, each, spoil

MPS_IN_A_KNOT = 0.514444
#: Odometry messages of a survey that some odd ones stand among.
SOME = range(600, 605)

Vector = tuple[float, float, float]


def _with_twist(survey: Survey, change: Callable[[Odometry, Vector, Vector], tuple]) -> Survey:
    """change(message, linear, angular) returns the other linear and angular velocity."""

    def changed(message: Odometry, _: float) -> Odometry:
        twist = message.twist.twist
        vectors = twist.linear, twist.angular
        values = change(message, *((v.x, v.y, v.z) for v in vectors))
        for vector, value in zip(vectors, values):
            vector.x, vector.y, vector.z = map(float, value)
        return message

    return each(survey, ODOMETRY, changed)


def _attitude(message: Odometry) -> Rotation:
    q = message.pose.pose.orientation
    return Rotation.from_quat([q.x, q.y, q.z, q.w])


def empty(survey: Survey) -> Survey:
    return _with_twist(survey, lambda _, linear, angular: ((0, 0, 0), (0, 0, 0)))


def without_rates(survey: Survey) -> Survey:
    return _with_twist(survey, lambda _, linear, angular: (linear, (0, 0, 0)))


def rates_in_degrees(survey: Survey) -> Survey:
    return _with_twist(survey, lambda _, linear, angular: (linear, map(math.degrees, angular)))


def in_odom_frame(survey: Survey) -> Survey:
    def turned(message: Odometry, linear: Vector, angular: Vector) -> tuple:
        attitude = _attitude(message)
        return attitude.apply(linear), attitude.apply(angular)

    return _with_twist(survey, turned)


def yaw_to_starboard(survey: Survey) -> Survey:
    return _with_twist(survey, lambda _, linear, w: (linear, (w[0], w[1], -w[2])))


def in_knots(survey: Survey) -> Survey:
    return _with_twist(survey, lambda _, v, angular: ([u / MPS_IN_A_KNOT for u in v], angular))


def some_of_speed(speed_mps: float) -> Callable[[Survey], Survey]:
    """Some messages say that the vehicle is as fast."""

    def make(survey: Survey) -> Survey:
        def fast(message: Odometry) -> Odometry:
            message.twist.twist.linear.x = speed_mps
            return message

        return spoil(survey, ODOMETRY, SOME, fast)

    return make


def some_turning_fast(survey: Survey) -> Survey:
    def spinning(message: Odometry) -> Odometry:
        message.twist.twist.angular.z = 1e3
        return message

    return spoil(survey, ODOMETRY, SOME, spinning)


def some_without_depth(survey: Survey) -> Survey:
    """A depth sensor's mark for no value."""

    def deep(message: Odometry) -> Odometry:
        message.pose.pose.position.z = -99999.0
        return message

    return spoil(survey, ODOMETRY, SOME, deep)


def some_with_quaternion_zero(survey: Survey) -> Survey:
    def zero(message: Odometry) -> Odometry:
        q = message.pose.pose.orientation
        q.x = q.y = q.z = q.w = 0.0
        return message

    return spoil(survey, ODOMETRY, SOME, zero)


#: A stop by the odometry's own contradiction; live it goes on, and says so.
NAME = "twist_against_pose"
TOLD_LIVE = finds(NAME, is_near=False)
CASES = [
    Case(
        "twist_empty",
        "twist",
        "all twists are zero",
        empty,
        Expected(report={"velocity_source": "pose"}),
    ),
    Case(
        "twist_without_rates",
        "twist",
        "angular velocities are zero",
        without_rates,
        stops(NAME, "yaw rate|rates"),
        TOLD_LIVE,
    ),
    Case(
        "rates_in_degrees",
        "twist",
        "angular velocities in degrees",
        rates_in_degrees,
        stops(NAME, "degree"),
        Expected(
            # turns are faster than any vehicle's, and too long a gap to know where it goes
            refused=("odometry/implausible_twist", "pings/in_gap"),
            counts_are_known=False,
            finds=(NAME,),
            is_near=False,
        ),
    ),
    Case(
        "twist_in_odom_frame",
        "twist",
        "velocities in the odometry's frame",
        in_odom_frame,
        stops(NAME, "frame"),
        TOLD_LIVE,
    ),
    Case("twist_in_knots", "twist", "speeds in knots", in_knots, stops(NAME, "knots"), TOLD_LIVE),
    Case(
        "yaw_to_starboard",
        "twist",
        "yaw rate of the other sign",
        yaw_to_starboard,
        stops(NAME, "sign|starboard"),
        TOLD_LIVE,
    ),
    Case(
        "twist_1e6",
        "impossible values",
        "5 messages of 10⁶ m/s",
        some_of_speed(1e6),
        refused("odometry/implausible_twist"),
    ),
    Case(
        "twist_1e300",
        "impossible values",
        "5 messages of 10³⁰⁰ m/s",
        some_of_speed(1e300),
        refused("odometry/implausible_twist"),
    ),
    Case(
        "twist_nan",
        "impossible values",
        "5 messages with a speed of NaN",
        some_of_speed(float("nan")),
        refused("odometry/not_finite"),
    ),
    Case(
        "turn_rate_1e3",
        "impossible values",
        "5 messages of 1000 rad/s",
        some_turning_fast,
        refused("odometry/implausible_twist"),
    ),
    Case(
        "depth_missing",
        "impossible values",
        "5 messages of z = −99,999 m",
        some_without_depth,
        refused("odometry/implausible_pose"),
    ),
    Case(
        "quaternion_zero",
        "impossible values",
        "5 messages with an orientation of zeros",
        some_with_quaternion_zero,
        refused("odometry/malformed"),
    ),
]
