"""Beams from what a sonar measures, travel times and angles, to points in the sensor's frame.

A transmitter's beam is a cone about its axis, a receiver's one about its own, turned by what the
vehicle has done in between; sound goes out along the line in which they meet (J. Beaudoin,
J. Hughes Clarke, J. Bartlett, "Application of surface sound speed measurements in post-processing
for multi-sector multibeam echosounders", 2004), and is bent by the water on its way.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from rbpf_svgp_slam.bags.recorded_survey import Trajectory, rotation_from_rpy
from rbpf_svgp_slam.importers.ray_tracing import bent, straight
from rbpf_svgp_slam.importers.sonar_recording import Installation, Placed, SoundSpeedProfile, Swath
from rbpf_svgp_slam.importers.vehicle_track import mount_rpy_rad, place_m

FORWARD, STARBOARD = np.array([1.0, 0.0, 0.0]), np.array([0.0, -1.0, 0.0])


def in_map(
    swath: Swath,
    track: Trajectory,
    installation: Installation,
    profile: SoundSpeedProfile | None,
) -> np.ndarray:
    """Points [B, 3] in the map frame, m; NaN without a detection."""
    sent_s = swath.time_s + swath.delay_s
    received_s = sent_s + np.nan_to_num(swath.travel_time_s)
    transmitter_m, transmitter_axis = _array(track, sent_s, installation.transmitter, FORWARD)
    receiver_m, receiver_axis = _array(track, received_s, installation.receiver, STARBOARD)
    direction, array_m = _where_cones_meet(
        (transmitter_m, transmitter_axis, np.sin(swath.tilt_rad)),
        (receiver_m, receiver_axis, np.sin(swath.angle_rad)),
    )
    horizontal = np.linalg.norm(direction[:, :2], axis=1)
    angle_rad = np.arctan2(horizontal, -direction[:, 2])
    one_way_s = 0.5 * swath.travel_time_s
    if profile is None:
        across_down_m = straight(angle_rad, one_way_s, swath.surface_speed_mps)
    else:
        depth_m = max(0.0, -float(array_m[:, 2].mean()))
        speed_mps = swath.surface_speed_mps
        across_down_m = bent(angle_rad, one_way_s, speed_mps, depth_m, profile)
    across_m, down_m = across_down_m.T
    towards = direction[:, :2] / np.maximum(horizontal, 1e-12)[:, None]
    return array_m + np.column_stack([towards * across_m[:, None], -down_m])


def in_sensor(points_m: np.ndarray, time_s: float, track: Trajectory, sensor: Placed) -> np.ndarray:
    """Points [B, 3] of the map frame in the sensor's, as it is at that time."""
    position_m, rpy_rad = track.poses_at(np.array([time_s]))
    in_base_m = rotation_from_rpy(rpy_rad)[0].inv().apply(points_m - position_m[0])
    mount = Rotation.from_euler("xyz", mount_rpy_rad(sensor))
    return mount.inv().apply(in_base_m - place_m(sensor))


def _array(
    track: Trajectory, time_s: np.ndarray, array: Placed, axis: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where an array is in map, and where its axis points, [B, 3] each, at times [B]."""
    position_m, rpy_rad = track.poses_at(time_s)
    turned = rotation_from_rpy(rpy_rad)
    in_base = Rotation.from_euler("xyz", mount_rpy_rad(array)).apply(axis)
    return position_m + turned.apply(place_m(array)), turned.apply(in_base)


def _where_cones_meet(
    sent: tuple[np.ndarray, ...], received: tuple[np.ndarray, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Directions [B, 3], unit vectors d with d·axis = sine for both, downwards; where they begin.

    sent, received: apex [B, 3], axis [B, 3] and sine [B] of the angle from the plane across it.
    NaN where the cones do not meet.
    """
    (sent_m, axis, sine), (received_m, other_axis, other_sine) = sent, received
    # with c = a·b and b' = (b - c a) / sqrt(1 - c²):  d = s a + (s_b - c s) / sqrt(1 - c²) b' + n
    cosine = np.sum(axis * other_axis, axis=1)
    across = np.sqrt(1 - cosine**2)
    perpendicular = (other_axis - cosine[:, None] * axis) / across[:, None]
    along = (other_sine - cosine * sine) / across
    normal = np.cross(axis, perpendicular)
    normal *= -np.sign(normal[:, 2:])  # z is up
    with np.errstate(invalid="ignore"):
        rest = np.sqrt(1 - sine**2 - along**2)
    direction = sine[:, None] * axis + along[:, None] * perpendicular + rest[:, None] * normal
    # each cone fixes the beam along its own axis, from its own apex; the way there and back is
    # as long as twice that from between both
    apart_m = received_m - sent_m
    to_receiver = np.sum(apart_m * perpendicular, axis=1)
    halfway = 0.5 * np.sum(apart_m * normal, axis=1)
    return direction, sent_m + to_receiver[:, None] * perpendicular + halfway[:, None] * normal
