"""The vehicle's track in the map frame, from positions, attitudes, heave and depth.

Here the sonars' convention ends: what leaves is as the package has it, x forward, y left, z up,
yaw counter-clockwise from east. Pitch then is bow down.
"""

from __future__ import annotations

import dataclasses
from typing import Iterable, Sequence

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation

from rbpf_svgp_slam.bags.recorded_survey import Mount, Trajectory, rotation_from_rpy
from rbpf_svgp_slam.importers.local_frame import LocalFrame
from rbpf_svgp_slam.importers.sonar_recording import Attitudes, Placed, Positions, Recording
from rbpf_svgp_slam.simulation.vehicle import body_rates

#: Positions or attitudes that are further apart leave a gap in the track.
GAP_S = 2.0
#: The fewest samples that make a track.
FEWEST = 4


def place_m(sensor: Placed) -> np.ndarray:
    """Of a sensor, from the reference point, [3], m: x forward, y left, z up."""
    return np.array([sensor.forward_m, -sensor.starboard_m, -sensor.down_m])


def mount_rpy_rad(sensor: Placed) -> tuple[float, float, float]:
    """Of a sensor's frame in the vehicle's."""
    return (sensor.roll_rad, -sensor.pitch_rad, -sensor.heading_rad)


def mount_of(sensor: Placed) -> Mount:
    """The sensor's frame in base_link."""
    return Mount(tuple(place_m(sensor).tolist()), mount_rpy_rad(sensor))


def make_tracks(recording: Recording, frame: LocalFrame, rate_hz: float) -> list[Trajectory]:
    """The vehicle's reference point, evenly sampled: a track for each time without a gap.

    Times are seconds since the epoch.
    """
    attitudes = _in_order(recording.attitudes)
    positions = _in_order(recording.positions)
    tracks = []
    for first_s, last_s in _known(attitudes.time_s, positions.time_s):
        steps = int((last_s - first_s) * rate_hz + 1e-6)
        if steps >= FEWEST:
            time_s = first_s + np.arange(steps + 1) / rate_hz
            tracks.append(_track(time_s, recording, attitudes, positions, frame))
    return tracks


def moving(time_s: np.ndarray, position_m: np.ndarray, rpy_rad: np.ndarray) -> Trajectory:
    """Poses [T, 3], [T, 3] at even times [T], and the twists that lead from one to the next."""
    period_s = time_s[1] - time_s[0]
    velocity_mps = np.gradient(position_m, period_s, axis=0)
    yaw_rate_radps = np.gradient(rpy_rad[:, 2], period_s)
    return Trajectory(
        time_s=time_s,
        position_m=position_m,
        rpy_rad=rpy_rad,
        linear_mps=rotation_from_rpy(rpy_rad).inv().apply(velocity_mps),
        angular_radps=body_rates(rpy_rad, yaw_rate_radps, period_s),
    )


def join(tracks: Sequence[Trajectory]) -> Trajectory:
    """One after the other, with the gaps between them; yaw goes on without a jump."""
    arrays = {}
    for column in dataclasses.fields(Trajectory):
        arrays[column.name] = np.concatenate([getattr(track, column.name) for track in tracks])
    arrays["rpy_rad"][:, 2] = np.unwrap(arrays["rpy_rad"][:, 2])
    return Trajectory(**arrays)


def _in_order(table):
    """Positions or attitudes by time, each time once, and finite."""
    columns = np.stack([getattr(table, field.name) for field in dataclasses.fields(table)])
    columns = columns[:, np.isfinite(columns).all(axis=0)]
    _, order = np.unique(columns[0], return_index=True)
    return type(table)(*columns[:, order])


def _known(*times_s: np.ndarray) -> Iterable[tuple[float, float]]:
    """Begin and end of each stretch in which all of them are known."""
    if any(len(one) < FEWEST // 2 for one in times_s):
        return
    first_s = max(one[0] for one in times_s)
    last_s = min(one[-1] for one in times_s)
    gaps = [(first_s, first_s), (last_s, last_s)]
    for one in times_s:
        wide = np.flatnonzero(np.diff(one) > GAP_S)
        gaps += zip(one[wide], one[wide + 1])
    end_s = first_s
    for gap_begin_s, gap_end_s in sorted(gaps):
        if first_s < gap_begin_s <= last_s and gap_begin_s > end_s:
            yield end_s, gap_begin_s
        end_s = max(end_s, gap_end_s)


def _track(
    time_s: np.ndarray,
    recording: Recording,
    attitudes: Attitudes,
    positions: Positions,
    frame: LocalFrame,
) -> Trajectory:
    installation = recording.installation
    rpy_rad = _attitude(time_s, attitudes, installation.motion)
    turned = rotation_from_rpy(rpy_rad)
    east_north_m = frame.east_north(positions.latitude_deg, positions.longitude_deg)
    xyz_m = np.empty((len(time_s), 3))
    # without overshoot between fixes that come once a second
    xyz_m[:, :2] = PchipInterpolator(positions.time_s, east_north_m)(time_s)
    xyz_m[:, :2] -= turned.apply(place_m(installation.positioning))[:, :2]
    xyz_m[:, 2] = _height(time_s, recording, attitudes, turned)
    return moving(time_s, xyz_m, rpy_rad)


def _attitude(time_s: np.ndarray, attitudes: Attitudes, sensor: Placed) -> np.ndarray:
    """Roll, pitch, yaw [T, 3] of the vehicle, from those of its motion sensor."""
    heading_rad = np.unwrap(attitudes.heading_rad)
    measured = np.stack(
        [
            np.interp(time_s, attitudes.time_s, attitudes.roll_rad),
            -np.interp(time_s, attitudes.time_s, attitudes.pitch_rad),
            np.pi / 2 - np.interp(time_s, attitudes.time_s, heading_rad),
        ],
        axis=1,
    )
    mount_rad = mount_rpy_rad(sensor)
    if any(mount_rad):
        # map <- sensor, less base <- sensor
        mount = Rotation.from_euler("xyz", mount_rad)
        measured = (rotation_from_rpy(measured) * mount.inv()).as_euler("ZYX")[:, ::-1]
    measured[:, 2] = np.unwrap(measured[:, 2])
    return measured


def _height(
    time_s: np.ndarray, recording: Recording, attitudes: Attitudes, turned: Rotation
) -> np.ndarray:
    """z [T] of the reference point: by the pressure sensor, or by waterline and heave, m."""
    installation, depths = recording.installation, recording.depths
    if depths is not None:  # heave is in them
        return -np.interp(time_s, depths.time_s, depths.depth_m)
    heave_m = np.interp(time_s, attitudes.time_s, attitudes.heave_m)
    # the reference point's own: roll and pitch lift a sensor that is away from it
    arm_m = place_m(installation.motion)
    lifted_m = turned.apply(arm_m)[:, 2] - arm_m[2]
    return installation.waterline_m + heave_m - lifted_m
