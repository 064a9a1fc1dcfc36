"""What an import tells its user, and the overlay beside the bag. Needs no ROS."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Sequence

import numpy as np

from rbpf_svgp_slam.checking.facts import ChosenTopics
from rbpf_svgp_slam.checking.overlay import ROOM, Overlay
from rbpf_svgp_slam.importers.degrade import drift_line
from rbpf_svgp_slam.importers.sonar_recording import Placed, Recording
from rbpf_svgp_slam.importers.sonar_survey import SonarSurvey
from rbpf_svgp_slam.importers.vehicle_track import GAP_S
from rbpf_svgp_slam.parameters.known import default_parameters

#: Between the array's probe and the profile's uppermost speed: some 2 °C.
CONTRADICTS_MPS = 5.0


def summary(bag: Path, recordings: Sequence[Recording], survey: SonarSurvey, wall_s: float) -> str:
    """Several lines: the files, what was assumed, what was left out, the bag."""
    lines = []
    for recording in recordings:
        lines.append(f"{recording.path}: {recording.sonar}, {len(recording.swaths)} pings")
        lines += [f"  found    {line}" for line in [*recording.found, *_found(recording)]]
        lines += [f"  assumed  {line}" for line in recording.assumed]
        if recording.cut_off:
            lines.append(f"  CUT OFF  {recording.cut_off}; all before it is kept")
    lines += [f"left out: {line}" for line in survey.lost]
    lines += _gaps(survey.recorded.odometry.time_s)
    recorded = survey.recorded
    latitude_deg, longitude_deg = recorded.origin_deg
    lines += [
        f"map frame: x east, y north of {latitude_deg:.6f}, {longitude_deg:.6f} (EPSG:4326), "
        "z up from the sea's surface",
        f"beams agree within {survey.agreement_m:.3f} m (RMS about the mean of their 1 m cell): "
        "what lever arms and mount angles should make small",
        f"{bag}: {len(recorded.ping_time_s)} pings, {sum(map(len, recorded.ping_points_m))} beams, "
        f"{recorded.odometry.time_s[-1] - recorded.odometry.time_s[0]:.1f} s, "
        f"{bag.stat().st_size / 1e6:.1f} MB in {wall_s:.1f} s",
        *_drift(survey),
        "",
        "rosrun rbpf_svgp_slam check_bag.py "
        f"{bag} {bag.with_suffix('.survey.yaml')}   # what SLAM would meet in it",
    ]
    return "\n".join(lines)


def overlay_text(bag: Path, path: Path, survey: SonarSurvey) -> str:
    """On config/default.yaml: the area, the origin, and what else must differ."""
    recorded = survey.recorded
    groups = {
        "survey_origin": list(recorded.origin_deg),
        "survey_area": survey.area_m,
    }
    comments = {
        "survey_origin": "Latitude and longitude of the map frame's origin, WGS84 (EPSG:4326).",
        "survey_area": "Around all that the beams have reached.",
    }
    if recorded.ground_truth is not None:
        noise = recorded.odometry_noise
        groups["motion"] = {
            "surge_std_m": noise.surge_m_per_sqrt_s,
            "sway_std_m": noise.sway_m_per_sqrt_s,
            "yaw_std_rad": noise.yaw_rad_per_sqrt_s,
        }
        comments["motion"] = (
            "White noise that the odometry was degraded with; its biases are not known to the "
            "filter."
        )
    bound_m = default_parameters()["pings"]["max_range_m"]
    if survey.longest_range_m > bound_m:
        groups["pings"] = {"max_range_m": float(math.ceil(ROOM * survey.longest_range_m))}
        comments["pings"] = f"Ranges reach {survey.longest_range_m:.0f} m."
    overlay = Overlay(groups, comments)
    return overlay.text(bag, ChosenTopics(None, None), path, "import_survey.py")


def _found(recording: Recording) -> list[str]:
    positions, attitudes = recording.positions, recording.attitudes
    lines = [
        f"{len(positions.time_s)} positions, {len(attitudes.time_s)} attitudes, from "
        f"{_utc(recording.swaths[0].time_s)} to {_utc(recording.swaths[-1].time_s)}"
    ]
    installation = recording.installation
    if installation.transmitter == installation.receiver:
        lines.append(f"sonar at {_place(installation.receiver)}")
    else:
        lines.append(f"transmitter at {_place(installation.transmitter)}")
        lines.append(f"receiver at {_place(installation.receiver)}")
    lines.append(f"positions are of {_place(installation.positioning)}")
    lines.append(f"attitudes are of {_place(installation.motion)}")
    lines.append(_water(recording))
    if recording.depths is None:
        lines.append(
            f"the vehicle's height by heave; waterline {installation.waterline_m:.3f} m below the "
            "reference point"
        )
    else:
        lines.append(f"{len(recording.depths.time_s)} depths of the vehicle")
    return lines


def _water(recording: Recording) -> str:
    if recording.computed:
        return "beams are the file's own soundings, corrected already, and laid out as they are"
    speeds_mps = [swath.surface_speed_mps for swath in recording.swaths]
    profile = recording.profile
    water = "no profile: rays are straight"
    if profile is not None:
        water = f"a profile of {len(profile.depth_m)} depths to {profile.depth_m[-1]:.0f} m"
        uppermost_mps = profile.speed_mps[0]
        if max(abs(speed_mps - uppermost_mps) for speed_mps in speeds_mps) > CONTRADICTS_MPS:
            water += (
                f", whose uppermost speed, {uppermost_mps:.1f} m/s, contradicts that: is it of "
                "this survey?"
            )
    return f"sound at the array {min(speeds_mps):.1f} to {max(speeds_mps):.1f} m/s; {water}"


def _place(sensor: Placed) -> str:
    angles = np.degrees([sensor.roll_rad, sensor.pitch_rad, sensor.heading_rad])
    turned = ", ".join(f"{angle:.2f}" for angle in angles)
    return (
        f"{sensor.forward_m:.3f} m forward, {sensor.starboard_m:.3f} m starboard, "
        f"{sensor.down_m + 0.0:.3f} m down, turned by {turned}° (roll, pitch, heading)"
    )


def _utc(time_s: float) -> str:
    return str(np.datetime64(round(1000 * time_s), "ms")).replace("T", " ")


def _gaps(time_s: np.ndarray) -> list[str]:
    steps_s = np.diff(time_s)
    wide = np.flatnonzero(steps_s > GAP_S)
    return [f"a gap of {steps_s[k]:.1f} s after {time_s[k] - time_s[0]:.1f} s" for k in wide]


def _drift(survey: SonarSurvey) -> list[str]:
    recorded = survey.recorded
    if recorded.ground_truth is None:
        return []
    return [drift_line(recorded.odometry, recorded.ground_truth)]
