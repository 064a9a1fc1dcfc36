"""The command line of simulate_survey.py."""

import argparse
import dataclasses
import math
import pathlib
import sys
import time

from rbpf_svgp_slam.bags.survey_bag import write_bag
from rbpf_svgp_slam.parameters.rules import ParameterError, checked, place
from rbpf_svgp_slam.simulation import SurveyError
from rbpf_svgp_slam.simulation.dead_reckoning import horizontal_errors
from rbpf_svgp_slam.simulation.mission import MISSIONS, get_mission
from rbpf_svgp_slam.simulation.simulation import simulate_survey
from rbpf_svgp_slam.simulation.sonar import SonarNoise
from rbpf_svgp_slam.simulation.terrain import save_terrain

_DESCRIPTION = """Simulate a multibeam survey and write it as a rosbag.

Beside F.bag come F.survey.yaml, a parameter overlay for the filter with what one knows before a
mission (the survey area, how the dead reckoning drifts, the origin if there is one), and
F.terrain.npz, the seabed with its place in the map frame."""

_TERRAIN_HELP = """the seabed (default: generated fractal relief with dunes): z [nx, ny] in m, z up,
axis 0 along x; resolution_m; optionally origin_m [2], x and y of z[0, 0] in the map frame, without
which the mission lies in the middle"""

_SCALE_HELP = """of the mission's full duration, roughly: both sides of the pattern shrink by the
share's square root (default 1)"""


def main(argv=None):
    """Run the simulator; returns the exit code: 2 for a mistake in the arguments or files."""
    arguments = _parse(argv)
    try:
        _run(arguments)
    except (SurveyError, ParameterError, OSError) as error:
        print(f"simulate_survey.py: error: {error}", file=sys.stderr)
        return 2
    return 0


def _parse(argv):
    parser = argparse.ArgumentParser(
        description=_DESCRIPTION, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--mission", required=True, metavar="NAME", help=f"one of {', '.join(MISSIONS)}")
    add("--out", required=True, metavar="F.bag", type=pathlib.Path, help="the bag to write")
    add("--terrain", metavar="F.npz", type=pathlib.Path, help=_TERRAIN_HELP)
    add("--seed", type=int, default=0, metavar="N", help="of all random numbers (default 0)")
    add("--scale", type=float, default=1.0, metavar="SHARE", help=_SCALE_HELP)
    add("--duration", type=float, default=math.inf, metavar="SECONDS", help="cut the survey there")
    add(
        "--outliers",
        type=float,
        default=SonarNoise.outlier_share,
        metavar="SHARE",
        help="false detections among the beams (default %(default)s)",
    )
    origin = "of the map frame, degrees of WGS84: where products lie (default: nowhere, and none)"
    add("--origin", type=float, nargs=2, metavar=("LATITUDE", "LONGITUDE"), help=origin)
    return parser.parse_args(argv)


def _run(arguments):
    mission = get_mission(arguments.mission, arguments.scale)
    _check(arguments)
    origin_deg = arguments.origin and checked("--origin", arguments.origin, place())
    started_s = time.monotonic()
    survey = simulate_survey(
        mission,
        arguments.seed,
        arguments.terrain,
        dataclasses.replace(SonarNoise(), outlier_share=arguments.outliers),
        arguments.duration,
        _progress_line("simulating pings"),
    )
    recorded = dataclasses.replace(survey.recorded(), origin_deg=origin_deg)
    write_bag(str(arguments.out), recorded, _progress_line("writing the bag"))
    save_terrain(arguments.out.with_suffix(".terrain.npz"), survey.terrain)
    write_overlay(arguments.out.with_suffix(".survey.yaml"), survey, origin_deg)
    _print_summary(arguments.out, survey, time.monotonic() - started_s)


def _check(arguments):
    if arguments.seed < 0:
        raise SurveyError(f"seed is {arguments.seed}, expected 0 or above")
    if not arguments.duration >= 10:
        raise SurveyError(f"duration is {arguments.duration} s, expected at least 10 s")
    if not 0 <= arguments.outliers <= 1:
        raise SurveyError(f"outliers is {arguments.outliers}, expected a share from 0 to 1")
    if arguments.out.suffix != ".bag":
        raise SurveyError(f"out is {arguments.out}, expected a name that ends in .bag")
    if not arguments.out.parent.is_dir():
        raise SurveyError(f"out is {arguments.out}, expected a file in an existing folder")


def write_overlay(path, survey, origin_deg=None):
    """Write what one knows of the survey before it as parameters of the filter.

    origin_deg: latitude and longitude of the map frame's origin, if it lies on the earth.
    """
    noise = survey.mission.dead_reckoning
    corners = ", ".join(f"[{x:.1f}, {y:.1f}]" for x, y in survey.area_m())
    origin = ""
    if origin_deg is not None:
        origin = "# Latitude and longitude of the map frame's origin, WGS84 (EPSG:4326).\n"
        origin += f"survey_origin: {list(origin_deg)}\n"
    path.write_text(
        f"{origin}"
        "# The seabed that the swath reaches, in the map frame.\n"
        f"survey_area: [{corners}]\n"
        "# The dead reckoning's white noise; its biases are not known to the filter.\n"
        "motion:\n"
        f"  surge_std_m: {noise.surge_m_per_sqrt_s}\n"
        f"  sway_std_m: {noise.sway_m_per_sqrt_s}\n"
        f"  yaw_std_rad: {noise.yaw_rad_per_sqrt_s}\n"
    )


def _progress_line(label):
    """A function of the share done that keeps one line up to date; silent off a terminal."""

    def show(share):
        if sys.stderr.isatty():
            end = "\n" if share >= 1 else ""
            print(f"\r{label} {100 * share:3.0f} %", end=end, file=sys.stderr, flush=True)

    return show


def _print_summary(path, survey, wall_s):
    final_m, rmse_m = horizontal_errors(survey.truth, survey.odometry)
    print(
        f"{path}: {survey.mission.name}, {len(survey.pings.time_s)} pings, "
        f"{survey.pings.beams} beams, {survey.truth.time_s[-1]:.0f} s of survey, "
        f"{path.stat().st_size / 1e6:.1f} MB in {wall_s:.1f} s\n"
        f"dead reckoning: final error {final_m:.2f} m, ATE RMSE {rmse_m:.2f} m (horizontal)"
    )
