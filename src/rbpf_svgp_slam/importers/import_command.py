"""The command line of import_survey.py."""

from __future__ import annotations

import argparse
import dataclasses
import math
import sys
import time
import warnings
from pathlib import Path
from typing import Sequence

import numpy as np

from rbpf_svgp_slam.bags.survey_bag import write_bag
from rbpf_svgp_slam.importers.formats import is_of_water, read_sonar_file
from rbpf_svgp_slam.importers.degrade import scaled
from rbpf_svgp_slam.importers.import_summary import overlay_text, summary
from rbpf_svgp_slam.importers.local_frame import LocalFrame
from rbpf_svgp_slam.importers.sonar_recording import Installation, Recording, SoundSpeedProfile
from rbpf_svgp_slam.importers.sonar_file import ImportProblem
from rbpf_svgp_slam.importers.sonar_survey import Degradation, make_survey
from rbpf_svgp_slam.simulation.dead_reckoning import DeadReckoningNoise

_DESCRIPTION = """Make a survey's bag of the files of a multibeam echosounder: XTF with R2Sonic's
pings, Kongsberg .all and .kmall, GSF.

Several files make one survey, in the order of their times, gaps kept. Beside F.bag comes
F.survey.yaml, an overlay for the filter with the survey area and the map frame's origin. The
summary says what was found in the files, and what was assumed."""

_ARM = ("FORWARD", "STARBOARD", "DOWN")
_NOT_FINER_THAN = 1e-4  # degrees; some 10 m: of a default origin
#: In a ship. Of the angles it keeps out only what is no number.
LONGEST_ARM_M = 500.0
#: Of the origin: the plane that touches the earth there is 800 m above a place so far away, and
#: distances there are 1 part in 8000 too short.
FARTHEST_ORIGIN_M = 1e5


def main(argv: Sequence[str] | None = None) -> int:
    """Run the import; returns the exit status: 2 for a mistake in the arguments or files."""
    options = _parse(argv)
    try:
        _run(options)
    except (ImportProblem, OSError) as error:
        print(f"import_survey.py: error: {error}", file=sys.stderr)
        return 2
    return 0


def _parse(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="import_survey.py",
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("files", metavar="FILE", type=Path, nargs="+")
    add("--out", required=True, metavar="F.bag", type=Path, help="the bag to write")
    origin = "of the map frame, degrees of WGS84 (default: the first position, rounded)"
    add("--origin", type=float, nargs=2, metavar=("LATITUDE", "LONGITUDE"), help=origin)
    add("--rate", type=float, default=50.0, metavar="HZ", help="of the odometry (default 50)")
    arm = "the sonar, from the reference point, m (default: the file's)"
    add("--sonar", type=float, nargs=3, metavar=_ARM, help=arm)
    angles = "how the sonar is mounted, degrees: starboard down, bow up, clockwise from above"
    add("--mount-angles", type=float, nargs=3, metavar=("ROLL", "PITCH", "HEADING"), help=angles)
    antenna = "what the positions are of, from the reference point, m"
    add("--antenna", type=float, nargs=3, metavar=_ARM, help=antenna)
    waterline = "below the reference point, m; negative if above it"
    add("--waterline", type=float, metavar="DOWN", help=waterline)
    profile = "sound speed: a text file, a line for each depth (m) and speed (m/s)"
    add("--profile", type=Path, metavar="F.txt", help=profile)
    degrade = "make drifting dead reckoning of the navigation, which becomes ground_truth"
    cut_off = "import what comes before the end of a file that is cut off"
    add("--keep-cut-off", action="store_true", help=cut_off)
    add("--degrade-odometry", type=int, metavar="SEED", help=degrade)
    drift = "its drift, as many times that of simulate_survey.py (default 1)"
    add("--drift", type=float, default=1.0, metavar="TIMES", help=drift)
    return parser.parse_args(argv)


def _run(options: argparse.Namespace) -> None:
    _check(options)
    started_s = time.monotonic()
    recordings = [_with_options(_read(path, options), options) for path in options.files]
    recordings.sort(key=lambda recording: recording.start_s)
    origin_deg = _origin_deg(options, recordings[0])
    degradation = None
    if options.degrade_odometry is not None:
        noise = scaled(DeadReckoningNoise(), options.drift)
        degradation = Degradation(noise, options.degrade_odometry)
    survey = make_survey(
        recordings, origin_deg, options.rate, degradation, _progress_line("placing beams")
    )
    write_bag(str(options.out), survey.recorded, _progress_line("writing the bag"))
    overlay = options.out.with_suffix(".survey.yaml")
    overlay.write_text(overlay_text(options.out, overlay, survey), encoding="utf-8")
    print(summary(options.out, recordings, survey, time.monotonic() - started_s))


def _read(path: Path, options: argparse.Namespace) -> Recording:
    recording = read_sonar_file(path)
    if recording.cut_off and not options.keep_cut_off:
        raise ImportProblem(
            f"{path}: {recording.cut_off}, expected all of it; --keep-cut-off imports what comes "
            "before"
        )
    return recording


def _check(options: argparse.Namespace) -> None:
    def expect(condition: bool, name: str, expected: str) -> None:
        if not condition:
            raise ImportProblem(f"{name} is {getattr(options, name)}, expected {expected}")

    expect(options.out.suffix == ".bag", "out", "a name that ends in .bag")
    expect(options.out.parent.is_dir(), "out", "a file in an existing folder")
    is_other = not (options.out.exists() and any(map(options.out.samefile, options.files)))
    expect(is_other, "out", "another file than those to be imported")
    expect(1.0 <= options.rate <= 1000.0, "rate", "1 to 1000 Hz")
    expect(0.0 <= options.drift < math.inf, "drift", "0 or above")
    expect((options.degrade_odometry or 0) >= 0, "degrade_odometry", "a seed from 0")
    for name in ("sonar", "mount_angles", "antenna", "waterline"):
        value = getattr(options, name)
        expect(value is None or bool(np.isfinite(value).all()), name, "finite numbers")


def _with_options(recording: Recording, options: argparse.Namespace) -> Recording:
    """With what the user knows better than the file."""
    for name in ("mount_angles", "profile"):
        value = getattr(options, name)
        if recording.computed and value is not None:
            raise ImportProblem(
                f"{name} is {value}, expected none for {recording.path}, whose soundings are "
                "computed already"
            )
    installation = recording.installation
    if options.sonar is not None:
        arm = dict(zip(("forward_m", "starboard_m", "down_m"), options.sonar))
        installation = _both_arrays(installation, arm)
    if options.mount_angles is not None:
        names = ("roll_rad", "pitch_rad", "heading_rad")
        installation = _both_arrays(
            installation, dict(zip(names, np.radians(options.mount_angles)))
        )
    if options.antenna is not None:
        arm = dict(zip(("forward_m", "starboard_m", "down_m"), options.antenna))
        positioning = dataclasses.replace(installation.positioning, **arm)
        installation = dataclasses.replace(installation, positioning=positioning)
    if options.waterline is not None:
        installation = dataclasses.replace(installation, waterline_m=options.waterline)
    _expect_aboard(recording.path, installation)
    profile = read_profile(options.profile) if options.profile else recording.profile
    return dataclasses.replace(recording, installation=installation, profile=profile)


def _expect_aboard(path: Path, installation: Installation) -> None:
    """Raises ImportProblem if file and options have a lever arm that no vehicle has, or none."""
    arms_m = {"waterline": (installation.waterline_m,)}
    for name in ("transmitter", "receiver", "positioning", "motion"):
        arms_m[name] = dataclasses.astuple(getattr(installation, name))
    for name, numbers in arms_m.items():
        if not (np.abs(numbers) < LONGEST_ARM_M).all():
            raise ImportProblem(
                f"{path}: {name} at {numbers}, expected finite numbers, within {LONGEST_ARM_M:g} m "
                "of the reference point"
            )


def _both_arrays(installation: Installation, values: dict[str, float]) -> Installation:
    return dataclasses.replace(
        installation,
        transmitter=dataclasses.replace(installation.transmitter, **values),
        receiver=dataclasses.replace(installation.receiver, **values),
    )


def read_profile(path: Path) -> SoundSpeedProfile:
    """Two columns, depth in m and sound speed in m/s. Raises ImportProblem."""
    expected = "two columns: depths from 0, increasing, in m; sound speeds, 1300 to 1800 m/s"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # numpy's, of an empty file
            depth_m, speed_mps = np.loadtxt(path, ndmin=2).T
    except ValueError as error:
        raise ImportProblem(f"{path}: {error}, expected {expected}") from error
    profile = SoundSpeedProfile(depth_m, speed_mps)
    if not is_of_water(profile) or depth_m[0] < 0:
        raise ImportProblem(f"{path}: depths {depth_m}, speeds {speed_mps}, expected {expected}")
    return profile


def _origin_deg(options: argparse.Namespace, recording: Recording) -> tuple[float, float]:
    """Latitude and longitude: the wanted ones, or the first position, rounded."""
    first = (recording.positions.latitude_deg[0], recording.positions.longitude_deg[0])
    if options.origin is not None:
        away_m = LocalFrame(*options.origin).distance_m(*first)
        if not away_m < FARTHEST_ORIGIN_M:
            raise ImportProblem(
                f"origin is {options.origin}, {away_m / 1000:.0f} km straight from the first "
                f"position, {first[0]:.4f}, {first[1]:.4f}, expected the latitude and longitude of "
                f"a place within {FARTHEST_ORIGIN_M / 1000:g} km"
            )
        return tuple(options.origin)
    return tuple(round(round(value / _NOT_FINER_THAN) * _NOT_FINER_THAN, 4) for value in first)


def _progress_line(label: str):
    """A function of the share done that keeps one line up to date; silent off a terminal."""

    def show(share: float) -> None:
        if sys.stderr.isatty():
            end = "\n" if share >= 1 else ""
            print(f"\r{label} {100 * share:3.0f} %", end=end, file=sys.stderr, flush=True)

    return show
