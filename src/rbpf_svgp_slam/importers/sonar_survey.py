"""A survey out of sonar files: one track, all pings, the map frame on the earth. Needs no ROS."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Callable, Sequence

import numpy as np

from rbpf_svgp_slam.bags.recorded_survey import OdometryNoise, RecordedSurvey, Trajectory
from rbpf_svgp_slam.checking.area_of_beams import area_around
from rbpf_svgp_slam.importers.beam_geometry import in_map, in_sensor, laid_out
from rbpf_svgp_slam.importers.degrade import degrade_odometry, odometry_noise
from rbpf_svgp_slam.importers.formats import SPEEDS_MPS
from rbpf_svgp_slam.importers.local_frame import LocalFrame
from rbpf_svgp_slam.importers.sonar_recording import (
    Attitudes,
    Depths,
    Installation,
    Positions,
    Recording,
    Soundings,
    Swath,
)
from rbpf_svgp_slam.importers.sonar_file import ImportProblem
from rbpf_svgp_slam.importers.vehicle_track import join, make_tracks, mount_of
from rbpf_svgp_slam.simulation.dead_reckoning import DeadReckoningNoise

#: Of each ping, so many beams at most, evenly chosen, tell the survey area and the agreement.
SAMPLED_BEAMS = 64
CELL_M = 1.0
#: Of the longest echo, from 20 km.
MOST_S = 30.0
NO_NOISE = OdometryNoise(0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Degradation:
    """Dead reckoning to be made of the navigation."""

    noise: DeadReckoningNoise
    seed: int


@dataclass(frozen=True)
class SonarSurvey:
    """What is imported. lost: lines on what was left out; times are relative to recorded.start_s.

    area_m: corners [[x, y], ...]; agreement_m: RMS of beams about the mean of their 1 m cell.
    """

    recorded: RecordedSurvey
    area_m: list[list[float]]
    longest_range_m: float
    agreement_m: float
    lost: list[str] = field(default_factory=list)


def merged(recordings: Sequence[Recording]) -> Recording:
    """One recording of several files in time order; those are of one installation.

    Its swaths, profile and lines are the first's.
    """
    first = recordings[0]
    for other in recordings[1:]:
        if other.installation != first.installation:
            differ = [
                f"{name} {value}, {vars(first.installation)[name]}"
                for name, value in vars(other.installation).items()
                if value != vars(first.installation)[name]
            ]
            raise ImportProblem(
                f"{other.path} has another installation than {first.path} ({'; '.join(differ)}), "
                "expected files of one survey"
            )
    has_depths = [one.depths is not None for one in recordings]
    if any(has_depths) and not all(has_depths):
        without = recordings[has_depths.index(False)].path
        raise ImportProblem(f"{without} has no depths of the vehicle, expected some as the others")
    return dataclasses.replace(
        first,
        positions=_joined(Positions, [one.positions for one in recordings]),
        attitudes=_joined(Attitudes, [one.attitudes for one in recordings]),
        depths=_joined(Depths, [one.depths for one in recordings]) if has_depths[0] else None,
    )


def make_survey(
    recordings: Sequence[Recording],
    origin_deg: tuple[float, float],
    rate_hz: float,
    degradation: Degradation | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> SonarSurvey:
    """Of files in time order. rate_hz: of the odometry. Raises ImportProblem."""
    whole = merged(recordings)
    tracks = make_tracks(whole, LocalFrame(*origin_deg), rate_hz)
    if not tracks:
        raise ImportProblem(
            f"{whole.path}: positions and attitudes have no time in common, expected some seconds"
        )
    pings = _pings(recordings, tracks, whole.installation, progress)
    start_s = int(tracks[0].time_s[0])
    truth = join([_since(start_s, track) for track in tracks])
    odometry, noise = truth, NO_NOISE
    if degradation is not None:
        degraded = degrade_odometry(tracks, degradation.noise, degradation.seed)
        odometry = join([_since(start_s, track) for track in degraded])
        noise = odometry_noise(degradation.noise)
    recorded = RecordedSurvey(
        start_s=start_s,
        odometry=odometry,
        odometry_noise=noise,
        mount=mount_of(whole.installation.receiver),
        ping_time_s=np.array(pings.time_s) - start_s,
        ping_points_m=pings.points_m,
        ground_truth=truth if degradation is not None else None,
        recorded_by="/import_survey",
        origin_deg=origin_deg,
    )
    sample_m = np.concatenate(pings.sample_m)
    area_m = area_around(sample_m[:, :2], np.concatenate(pings.reach_m))
    longest_m = max(float(np.linalg.norm(one, axis=1).max()) for one in pings.points_m)
    return SonarSurvey(recorded, area_m, longest_m, _agreement(sample_m), pings.lost())


def _joined(table, parts):
    names = [column.name for column in dataclasses.fields(table)]
    return table(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def _since(start_s: float, track: Trajectory) -> Trajectory:
    return dataclasses.replace(track, time_s=track.time_s - start_s)


@dataclass
class _Pings:
    """What becomes of the swaths; a sample of beams in map [N, 3] and their reach [N], m."""

    time_s: list[float] = field(default_factory=list)
    points_m: list[np.ndarray] = field(default_factory=list)
    sample_m: list[np.ndarray] = field(default_factory=list)
    reach_m: list[np.ndarray] = field(default_factory=list)
    outside: int = 0  # of the tracks
    empty: int = 0  # without a beam
    twice: int = 0  # of one time

    def lost(self) -> list[str]:
        """Lines for the summary."""
        counted = (
            (self.outside, "outside the time of positions and attitudes"),
            (self.empty, "without a beam"),
            (self.twice, "that came before already"),
        )
        return [f"{count} pings {why}" for count, why in counted if count]


def _pings(
    recordings: Sequence[Recording],
    tracks: Sequence[Trajectory],
    installation: Installation,
    progress: Callable[[float], None],
) -> _Pings:
    pings = _Pings()
    swaths = [(swath, recording) for recording in recordings for swath in recording.swaths]
    swaths.sort(key=lambda pair: pair[0].time_s)
    for count, (swath, recording) in enumerate(swaths):
        progress(count / len(swaths))
        _add(pings, swath, recording, tracks, installation)
    progress(1.0)
    if not pings.time_s:
        raise ImportProblem(
            f"{recordings[0].path}: no ping has beams, a position and an attitude "
            f"({'; '.join(pings.lost())})"
        )
    return pings


def _add(
    pings: _Pings,
    swath: Swath | Soundings,
    recording: Recording,
    tracks: Sequence[Trajectory],
    installation: Installation,
) -> None:
    if isinstance(swath, Swath):
        swath = _plausible(swath)
    if pings.time_s and swath.time_s <= pings.time_s[-1]:
        pings.twice += 1
        return
    end_s = _end_s(swath)
    track = next((t for t in tracks if t.time_s[0] <= swath.time_s and end_s <= t.time_s[-1]), None)
    if track is None:
        pings.outside += 1
        return
    if isinstance(swath, Soundings):
        map_m = laid_out(swath, track, installation.positioning)
    else:
        map_m = in_map(swath, track, installation, recording.profile, recording.speed_of_profile)
    map_m = map_m[np.isfinite(map_m).all(axis=1)]
    if not len(map_m):
        pings.empty += 1
        return
    points_m = in_sensor(map_m, swath.time_s, track, installation.receiver)
    pings.time_s.append(swath.time_s)
    pings.points_m.append(points_m.astype(np.float32))
    sample_m = map_m[:: max(1, len(map_m) // SAMPLED_BEAMS)]
    vehicle_m = track.poses_at(np.array([swath.time_s]))[0][0]
    pings.sample_m.append(sample_m)
    pings.reach_m.append(np.linalg.norm((sample_m - vehicle_m)[:, :2], axis=1))


def _end_s(swath: Swath | Soundings) -> float:
    """When the last beam is back."""
    if isinstance(swath, Soundings):
        return swath.time_s
    return swath.time_s + np.max(swath.delay_s + np.nan_to_num(swath.travel_time_s), initial=0.0)


def _plausible(swath: Swath) -> Swath:
    """Without beams that took longer than any echo does, or where the sound's speed is none."""
    travel_time_s, delay_s = swath.travel_time_s, swath.delay_s
    with np.errstate(invalid="ignore"):
        good = (0 < travel_time_s) & (travel_time_s < MOST_S) & (np.abs(delay_s) < MOST_S)
    good &= SPEEDS_MPS[0] < swath.surface_speed_mps < SPEEDS_MPS[1]
    travel_time_s, delay_s = np.where(good, travel_time_s, np.nan), np.where(good, delay_s, 0.0)
    return dataclasses.replace(swath, travel_time_s=travel_time_s, delay_s=delay_s)


def _agreement(points_m: np.ndarray) -> float:
    """RMS of heights [N, 3] about the mean of their cell, m."""
    cells = np.floor(points_m[:, :2] / CELL_M).astype(int)
    _, cell, count = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    cell = cell.reshape(-1)
    mean_m = np.bincount(cell, points_m[:, 2]) / count
    return float(np.sqrt(np.mean((points_m[:, 2] - mean_m[cell]) ** 2)))
