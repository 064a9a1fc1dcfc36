"""Axes and areas that are not what they are said to be."""

from __future__ import annotations

from nav_msgs.msg import Odometry

from bag_cases.clouds import beams, cloud
from bag_cases.expected import RIGHT, Case, finds
from bag_cases.survey import ODOMETRY, PINGS, TRUTH, Survey, each

UTM_M = (500000.0, 6400000.0)


def pings_z_down(survey: Survey) -> Survey:
    """x forward, y to starboard, z down, while the mount says that nothing is turned."""
    return each(survey, PINGS, lambda m, _: cloud(m, beams(m) * [1, -1, -1]))


def depth_positive(survey: Survey) -> Survey:
    """Depth stands in the pose as a positive z."""

    def deep(message: Odometry, _: float) -> Odometry:
        message.pose.pose.position.z *= -1.0
        message.twist.twist.linear.z *= -1.0
        return message

    return each(survey, ODOMETRY, deep)


def _moved(survey: Survey, by_m: tuple[float, float]) -> Survey:
    def move(message: Odometry, _: float) -> Odometry:
        message.pose.pose.position.x += by_m[0]
        message.pose.pose.position.y += by_m[1]
        return message

    return each(each(survey, ODOMETRY, move), TRUTH, move)


def _with_area(survey: Survey, area: list[list[float]]) -> Survey:
    return survey.replace(overlay={**survey.overlay, "survey_area": area})


def utm(survey: Survey) -> Survey:
    x, y = UTM_M
    area = [[a + x, b + y] for a, b in survey.overlay["survey_area"]]
    return _with_area(_moved(survey, UTM_M), area)


def utm_area_local(survey: Survey) -> Survey:
    return _moved(survey, UTM_M)


def area_next_door(survey: Survey) -> Survey:
    """The area of the survey before, half a kilometre away."""
    return _with_area(survey, [[a + 500.0, b] for a, b in survey.overlay["survey_area"]])


def area_closed_ring(survey: Survey) -> Survey:
    area = survey.overlay["survey_area"]
    return _with_area(survey, [*area, area[0]])


CASES = [
    Case(
        "pings_z_down",
        "geometry",
        "pings with z down, mount unturned",
        pings_z_down,
        finds("beams_above_vehicle"),
    ),
    Case(
        "depth_positive",
        "geometry",
        "depth as positive z in the pose",
        depth_positive,
        finds("seabed_above_sea", is_near=False),
    ),
    Case("utm", "geometry", "UTM in odometry and area", utm, RIGHT),
    Case(
        "utm_area_local",
        "geometry",
        "odometry in UTM, a local area",
        utm_area_local,
        finds("area_missed"),
    ),
    Case(
        "area_next_door",
        "geometry",
        "the area lies 500 m off",
        area_next_door,
        finds("area_missed"),
    ),
    Case(
        "area_closed_ring",
        "geometry",
        "the polygon's first corner again as its last",
        area_closed_ring,
        RIGHT,
    ),
]
