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
from rbpf_svgp_slam.importers.ray_tracing import bent
from rbpf_svgp_slam.importers.sonar_recording import (
    Installation,
    Placed,
    SoundSpeedProfile,
    Soundings,
    Swath,
)
from rbpf_svgp_slam.importers.vehicle_track import mount_rpy_rad, place_m

#: Of the search for the way back's length. It shortens the error by the arrays' distance over the
#: range each time: ten to a millimetre for arrays 2 m apart in 5 m of water.
ROUNDS = 10
FORWARD, STARBOARD = np.array([1.0, 0.0, 0.0]), np.array([0.0, -1.0, 0.0])


def in_map(
    swath: Swath,
    track: Trajectory,
    installation: Installation,
    profile: SoundSpeedProfile | None,
    speed_of_profile: bool = False,
) -> np.ndarray:
    """Points [B, 3] in the map frame, m; NaN without a detection.

    speed_of_profile: the beams' angles are those in the profile's water, as
    Recording.speed_of_profile.
    """
    sent_s = swath.time_s + swath.delay_s
    received_s = sent_s + np.nan_to_num(swath.travel_time_s)
    transmitter_m, transmitter_axis = _array(track, sent_s, installation.transmitter, FORWARD)
    receiver_m, receiver_axis = _array(track, received_s, installation.receiver, STARBOARD)
    depth_m = max(0.0, -0.5 * float((transmitter_m + receiver_m)[:, 2].mean()))
    speed_mps = swath.surface_speed_mps
    if profile is not None and speed_of_profile:
        speed_mps = float(np.interp(depth_m, profile.depth_m, profile.speed_mps))
    straight_m = _where_cones_meet(
        (transmitter_m, transmitter_axis, np.sin(swath.tilt_rad)),
        (receiver_m, receiver_axis, np.sin(swath.angle_rad)),
        speed_mps * swath.travel_time_s,
    )
    if profile is None:
        return straight_m
    # the way there and the way back, taken as one from between the arrays
    array_m = 0.5 * (transmitter_m + receiver_m)
    towards_m = straight_m - array_m
    horizontal_m = np.linalg.norm(towards_m[:, :2], axis=1)
    across_m, down_m = bent(
        np.arctan2(horizontal_m, -towards_m[:, 2]),
        np.linalg.norm(towards_m, axis=1) / speed_mps,
        speed_mps,
        depth_m,
        profile,
    ).T
    towards_m[:, :2] *= (across_m / np.maximum(horizontal_m, 1e-9))[:, None]
    towards_m[:, 2] = -down_m
    return array_m + towards_m


def laid_out(soundings: Soundings, track: Trajectory, positioning: Placed) -> np.ndarray:
    """Points [B, 3] in the map frame, m, about where the positioning sensor is at that time."""
    position_m, rpy_rad = track.poses_at(np.array([soundings.time_s]))
    from_m = position_m[0] + rotation_from_rpy(rpy_rad)[0].apply(place_m(positioning))
    forward_m, starboard_m, down_m = soundings.place_m.T
    east, north = np.sin(soundings.heading_rad), np.cos(soundings.heading_rad)
    x_m = from_m[0] + forward_m * east + starboard_m * north
    y_m = from_m[1] + forward_m * north - starboard_m * east
    return np.column_stack([x_m, y_m, -down_m])


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
    sent: tuple[np.ndarray, ...], received: tuple[np.ndarray, ...], way_m: np.ndarray
) -> np.ndarray:
    """Where sound of one speed turns back, [B, 3], below both arrays.

    sent, received: an array's place [B, 3], its axis [B, 3], the sine [B] of the beam's angle from
    the plane across the axis; way_m [B]: there and back. NaN where cones and ellipsoid do not meet.
    """
    (sent_m, axis, sine), (received_m, other_axis, other_sine) = sent, received
    cosine = np.sum(axis * other_axis, axis=1)
    across = np.sqrt(1 - cosine**2)
    perpendicular = (other_axis - cosine[:, None] * axis) / across[:, None]
    normal = np.cross(axis, perpendicular)
    normal *= -np.sign(normal[:, 2:])  # z is up
    to_receiver_m = received_m - sent_m
    to_receiver = np.sum(to_receiver_m * other_axis, axis=1)
    back_m = 0.5 * way_m
    for _ in range(ROUNDS):
        there_m = way_m - back_m
        # with the point p from the transmitter, its axis a and the receiver's b = c a + s b':
        # p·a = sin(tilt) there,  (p - receiver)·b = sin(angle) back,  |p| = there
        along_m = sine * there_m
        aside_m = (other_sine * back_m + to_receiver - cosine * along_m) / across
        below_m2 = there_m**2 - along_m**2 - aside_m**2
        below_m = np.sqrt(np.maximum(below_m2, 0.0))
        point_m = along_m[:, None] * axis + aside_m[:, None] * perpendicular
        point_m += below_m[:, None] * normal
        # as much longer as this was, that will be shorter: the truth is halfway
        back_m = 0.5 * (back_m + np.linalg.norm(point_m - to_receiver_m, axis=1))
    point_m[~(below_m2 > 0)] = np.nan
    return sent_m + point_m
