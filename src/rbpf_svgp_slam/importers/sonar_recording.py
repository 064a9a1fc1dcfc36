"""What a sonar's file tells, whoever made it: in the sonars' own convention.

Vehicle and arrays: x forward, y to starboard, z down. Roll: starboard down; pitch: bow up; heading:
clockwise from true north. Times are seconds since the epoch (UTC).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class Positions:
    """Of the vehicle's positioning sensor: arrays [N], WGS84."""

    time_s: np.ndarray
    latitude_deg: np.ndarray
    longitude_deg: np.ndarray


@dataclass(frozen=True)
class Attitudes:
    """Of the vehicle's motion sensor: arrays [N]; heave_m up."""

    time_s: np.ndarray
    roll_rad: np.ndarray
    pitch_rad: np.ndarray
    heading_rad: np.ndarray
    heave_m: np.ndarray


@dataclass(frozen=True)
class Depths:
    """Of the vehicle's pressure sensor, in a vehicle that dives: arrays [N]; below the surface."""

    time_s: np.ndarray
    depth_m: np.ndarray


@dataclass(frozen=True)
class Placed:
    """A sensor in the vehicle: its place from the reference point, m, and its mount angles, rad."""

    forward_m: float = 0.0
    starboard_m: float = 0.0
    down_m: float = 0.0
    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    heading_rad: float = 0.0


@dataclass(frozen=True)
class Installation:
    """Where everything is on the vehicle. waterline_m: below the reference point."""

    transmitter: Placed = Placed()
    receiver: Placed = Placed()
    positioning: Placed = Placed()
    motion: Placed = Placed()
    waterline_m: float = 0.0


@dataclass(frozen=True)
class Swath:
    """The beams of one ping, arrays [B]; those without a detection have a travel time of NaN.

    time_s: of the first transmission; delay_s: of each beam's transmission after it;
    travel_time_s: there and back; tilt_rad: of the transmission, forward from the transmitter's
    plane; angle_rad: of reception, to starboard from the receiver's plane; surface_speed_mps: of
    sound at the array. maker_m [B, 3], if the file has it: the maker's own solution, x forward and
    y starboard of the reference point, z below the surface, levelled, m.
    """

    time_s: float
    delay_s: np.ndarray
    travel_time_s: np.ndarray
    tilt_rad: np.ndarray
    angle_rad: np.ndarray
    surface_speed_mps: float
    maker_m: np.ndarray | None = None


@dataclass(frozen=True)
class Soundings:
    """The beams of one ping as others have computed them: no travel times are left to trace.

    place_m [B, 3]: x forward and y starboard of the position, z below the surface or the datum of
    the file, levelled, m; heading_rad: what forward is.
    """

    time_s: float
    heading_rad: float
    place_m: np.ndarray


@dataclass(frozen=True)
class SoundSpeedProfile:
    """Sound speed [N] at depths [N] below the surface, increasing."""

    depth_m: np.ndarray
    speed_mps: np.ndarray


@dataclass
class Recording:
    """One file. Sound speed profile and depths are None where it has none.

    speed_of_profile: angles are those in the profile's water at the array, whatever the array's
    own probe says, as the maker's processing takes them. found, assumed: lines for the summary;
    cut_off: where and how the file ends too early, or "".
    """

    path: Path
    sonar: str
    positions: Positions
    attitudes: Attitudes
    swaths: list[Swath] | list[Soundings]
    installation: Installation
    profile: SoundSpeedProfile | None = None
    depths: Depths | None = None
    speed_of_profile: bool = False
    found: list[str] = field(default_factory=list)
    assumed: list[str] = field(default_factory=list)
    cut_off: str = ""

    @property
    def computed(self) -> bool:
        """Whether the beams are soundings, which no profile and no mount angle changes."""
        return any(isinstance(swath, Soundings) for swath in self.swaths)

    @property
    def start_s(self) -> float:
        """The first ping's time, or the first position's."""
        return self.swaths[0].time_s if self.swaths else float(self.positions.time_s[0])


def nothing_yet(path: Path, sonar: str, speed_of_profile: bool = False) -> Recording:
    """Of a file that is about to be read."""
    none = np.zeros(0)
    return Recording(
        path,
        sonar,
        Positions(none, none, none),
        Attitudes(none, none, none, none, none),
        [],
        Installation(),
        speed_of_profile=speed_of_profile,
    )
