"""The missions: what is surveyed, with which vehicle and sonar, and the lines to follow.

hugin1, lolo2 and lolo3 are for the paper's three experiments (Torroba et al. 2023, Table 1). The
paper's are hugin1's 8.08 million beams in 4.45 h, lolo2's 12.4 million in 2.25 h, and lolo3's area
of 250 m x 150 m. All else is ours: values usual for the two vehicles (Lolo, a 1-2 m/s research AUV;
Hugin, a 2 m/s survey AUV), areas that take that long, ping rates that give that many beams, and the
pattern: lines along x, crossing lines along y over all of them, and the way back to the start, so
that the seabed is seen more than once. `demo` is wholly ours: simulated in seconds, over relief and
with drift that make correcting worthwhile.
"""

import dataclasses
import math

import numpy as np

from rbpf_svgp_slam.simulation import SurveyError
from rbpf_svgp_slam.simulation.dead_reckoning import DeadReckoningNoise
from rbpf_svgp_slam.simulation.terrain import Relief


@dataclasses.dataclass(frozen=True)
class Mission:
    """A survey of the rectangle (0, 0) .. area_m in the map frame."""

    name: str
    area_m: tuple  # (x, y) of the seabed to be covered
    inset_m: float  # from the area's edge to the outermost lines, so that turns stay inside
    line_spacing_m: float
    crossing_spacing_m: float  # infinity: no crossing lines
    speed_mps: float
    altitude_m: float
    beams: int
    ping_rate_hz: float
    swath_rad: float  # opening angle of the fan
    max_range_m: float  # the sonar's range gate
    terrain_resolution_m: float  # of generated terrain
    seabed_m: float  # mean height of generated terrain
    dead_reckoning: DeadReckoningNoise
    relief: Relief = Relief()  # of generated terrain
    max_yaw_rate_radps: float = math.radians(12)
    odometry_rate_hz: float = 20.0

    @property
    def turn_radius_m(self):
        """The tightest turn at survey speed."""
        return self.speed_mps / self.max_yaw_rate_radps

    @property
    def margin_m(self):
        """What generated terrain needs around the area: an overshot turn and a full swath."""
        return 2 * self.turn_radius_m + self.max_range_m


_DEGREE = math.pi / 180

_LOLO = DeadReckoningNoise(yaw_rad_per_sqrt_s=0.0015, gyro_bias_radps=2e-5)
_HUGIN = DeadReckoningNoise(
    surge_m_per_sqrt_s=0.12,
    sway_m_per_sqrt_s=0.12,
    yaw_rad_per_sqrt_s=0.0001,
    surge_scale=0.002,
    gyro_bias_radps=2e-6,
)

MISSIONS = {
    mission.name: mission
    for mission in (
        Mission(
            name="demo",
            area_m=(200.0, 120.0),
            inset_m=15.0,
            line_spacing_m=18.0,
            crossing_spacing_m=17.0,
            speed_mps=2.0,
            altitude_m=17.0,
            beams=96,
            ping_rate_hz=3.0,
            swath_rad=120 * _DEGREE,
            max_range_m=38.0,
            terrain_resolution_m=0.5,
            seabed_m=-40.0,
            dead_reckoning=DeadReckoningNoise(),
        ),
        Mission(
            name="lolo2",
            area_m=(545.0, 330.0),
            inset_m=15.0,
            line_spacing_m=20.0,
            crossing_spacing_m=65.0,
            speed_mps=1.5,
            altitude_m=14.0,
            beams=256,
            ping_rate_hz=6.0,
            swath_rad=120 * _DEGREE,
            max_range_m=32.0,
            terrain_resolution_m=0.5,
            seabed_m=-35.0,
            dead_reckoning=_LOLO,
        ),
        Mission(
            name="lolo3",
            area_m=(250.0, 150.0),
            inset_m=15.0,
            line_spacing_m=20.0,
            crossing_spacing_m=55.0,
            speed_mps=1.5,
            altitude_m=14.0,
            beams=256,
            ping_rate_hz=4.0,
            swath_rad=120 * _DEGREE,
            max_range_m=32.0,
            terrain_resolution_m=0.5,
            seabed_m=-35.0,
            dead_reckoning=_LOLO,
        ),
        Mission(
            name="hugin1",
            area_m=(1590.0, 1000.0),
            inset_m=50.0,
            line_spacing_m=60.0,
            crossing_spacing_m=500.0,
            speed_mps=2.0,
            altitude_m=38.0,
            beams=512,
            ping_rate_hz=0.985,
            swath_rad=120 * _DEGREE,
            max_range_m=85.0,
            terrain_resolution_m=1.0,
            seabed_m=-90.0,
            max_yaw_rate_radps=4 * _DEGREE,
            dead_reckoning=_HUGIN,
            # Over a square kilometre and more the large features are the high ones.
            relief=Relief(longest_m=900.0, fractal_m=6.0, dunes_m=0.3),
        ),
    )
}


def get_mission(name, scale=1.0):
    """The mission of that name, its lines shortened so that it takes about `scale` of its time.

    Spacing, speed and sonar stay: both sides of the rectangle of lines shrink by sqrt(scale). It
    takes somewhat longer than that share, for there are at least two lines and three crossings.
    """
    if name not in MISSIONS:
        raise SurveyError(f"mission is '{name}', expected one of {', '.join(MISSIONS)}")
    if not 0 < scale <= 10:
        raise SurveyError(f"scale is {scale}, expected a number above 0 and up to 10")
    mission = MISSIONS[name]
    lines_m = [(side - 2 * mission.inset_m) * math.sqrt(scale) for side in mission.area_m]
    if min(lines_m) < 2 * mission.turn_radius_m:
        raise SurveyError(
            f"scale is {scale}, which leaves {name} lines of {min(lines_m):.1f} m; expected at "
            f"least two turn radii, {2 * mission.turn_radius_m:.1f} m"
        )
    area_m = tuple(side + 2 * mission.inset_m for side in lines_m)
    return dataclasses.replace(mission, area_m=area_m)


def plan_waypoints(mission):
    """Waypoints [W, 2] in the map frame: lines along x, crossing lines along y, the start again."""
    lower = np.full(2, mission.inset_m)
    upper = np.array(mission.area_m) - mission.inset_m
    points = [lower]
    for axis, spacing_m in ((0, mission.line_spacing_m), (1, mission.crossing_spacing_m)):
        across = 1 - axis
        if math.isinf(spacing_m):
            continue
        count = max(2, round((upper[across] - lower[across]) / spacing_m) + 1)
        if axis == 1:
            count |= 1  # an odd number ends on the start's side, without doubling back on a line
        # From wherever the last line ended, so that no time is lost between the two patterns.
        low_to_high = points[-1][across] == lower[across]
        offsets = np.linspace(lower[across], upper[across], count)
        for offset in offsets if low_to_high else offsets[::-1]:
            entry, leave = np.empty(2), np.empty(2)
            entry[across] = leave[across] = offset
            entry[axis] = points[-1][axis]
            leave[axis] = lower[axis] + upper[axis] - entry[axis]
            points += [entry, leave]
    points.append(lower)
    points = np.array(points)
    moved = np.any(np.diff(points, axis=0) != 0, axis=1)
    return points[np.concatenate([[True], moved])]
