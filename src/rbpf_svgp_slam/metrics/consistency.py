"""Self-consistency of a survey: how far apart its passes see the same seabed.

Roman and Singh, "Consistency based error evaluation for deep sea bathymetric mapping with robotic
vehicles" (ICRA 2006), as implemented by the paper's group. It needs no ground truth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from rbpf_svgp_slam.metrics.cells import cell_centres, cell_keys, neighbour_keys
from rbpf_svgp_slam.metrics.map_metrics import rmse

TURN_RAD = np.deg2rad(45)
CHUNKS_WITHOUT_TURNS = 10


@dataclass(frozen=True)
class ConsistencySettings:
    """The metric depends on all of these, so the report states them."""

    resolution_m: float = 1.0
    draws: int = 10
    seed: int = 0
    max_beams: int = 1_000_000  # more are thinned at random, to keep the time to seconds
    max_points_per_cell: int = 20  # of each pass


@dataclass(frozen=True)
class Consistency:
    """The metric, and its map over the C cells that two passes or more have hit themselves.

    The group's code also compares a pass with others that hit only the cells around, so that
    along the edge of every swath it measures the width of a cell. `overlap_rms_m` leaves those out.
    """

    rms_m: float | None  # as the group has it; None where no passes meet
    overlap_rms_m: float | None  # over pairs of passes that have both hit the cell
    centre_m: np.ndarray  # [C, 2] map frame
    error_m: np.ndarray  # [C] > 0, behind overlap_rms_m
    points_per_cell_and_pass: float | None  # the density, after thinning


def split_passes(yaw_rad: np.ndarray) -> np.ndarray:
    """Number the passes that are compared with each other: the pass [P] of each ping, from its
    headings [P]. Its survey lines; a survey that never turns is cut into ten equal chunks."""
    lines = survey_lines(yaw_rad)
    if len(lines) and not lines.any():
        return np.arange(len(lines)) * CHUNKS_WITHOUT_TURNS // len(lines)
    return lines


def survey_lines(yaw_rad: np.ndarray) -> np.ndarray:
    """Number the lines of a survey: the line [P] of each ping, from its headings [P].

    A line ends where the heading has left the mean heading of the line so far by more than 45°.
    Pieces shorter than a quarter of the typical line are turns, and join the line before them;
    typical is the longest length such that half of all pings lie in lines at least as long.
    """
    heading = np.unwrap(yaw_rad)
    starts, mean, count = [0], heading[0] if len(heading) else 0.0, 0
    for i, angle in enumerate(heading):
        if abs(angle - mean) > TURN_RAD:
            starts.append(i)
            mean, count = angle, 0
        count += 1
        mean += (angle - mean) / count
    lengths = np.diff([*starts, len(heading)])
    descending = np.sort(lengths)[::-1]
    typical = descending[np.searchsorted(np.cumsum(descending), len(heading) / 2)]
    is_line = 4 * lengths >= typical
    is_line[0] = True
    return np.repeat(np.cumsum(is_line) - 1, lengths)


def consistency(
    points: np.ndarray,
    pass_of_point: np.ndarray,
    settings: ConsistencySettings,
    rng: np.random.Generator,
) -> Consistency:
    """Compare the passes of points [n, 3] (m, map frame); pass_of_point [n] are small integers.

    Per cell: the mean over the draws of the largest distance, over ordered pairs of passes, from
    a random point of the one in the cell to the nearest of the other in the 3 × 3 cells around.
    Then the RMS over the cells above zero.
    """
    points, passes, keys = _sort_and_thin(points, pass_of_point, settings, rng)
    if not len(points):
        return Consistency(None, None, np.empty((0, 2)), np.empty(0), None)
    cell_key, first_of_cell, cell = np.unique(keys, return_index=True, return_inverse=True)
    new_group = np.diff(cell, prepend=-1) + np.abs(np.diff(passes, prepend=-1)) > 0
    start = np.flatnonzero(new_group)
    count = np.diff(start, append=len(points))
    first_group_of_cell = np.searchsorted(start, first_of_cell)
    drawn = start + (rng.random((settings.draws, len(start))) * count).astype(int)
    of, place = np.unique(drawn, return_inverse=True)
    distance = farthest_pass_distance(points, passes, cell_key, cell, of)[place]
    error = np.zeros((len(cell_key), 2))
    for of_draw in distance.reshape(*drawn.shape, 2):
        error += np.maximum.reduceat(of_draw, first_group_of_cell) / settings.draws
    around, overlap = error.T
    hit = overlap > 0
    return Consistency(
        rms_m=rmse(around[around > 0]),
        overlap_rms_m=rmse(overlap[hit]),
        centre_m=cell_centres(cell_key[hit], settings.resolution_m),
        error_m=overlap[hit],
        points_per_cell_and_pass=float(count.mean()),
    )


def farthest_pass_distance(
    points: np.ndarray, passes: np.ndarray, cell_key: np.ndarray, cell: np.ndarray, of: np.ndarray
) -> np.ndarray:
    """Return for points `of` [m] the largest over the other passes of the distance to the nearest.

    Points [n, 3] are sorted by cell; cell [n] indexes the sorted cell_key [C]; `of` indexes points.
    Only points in the 3 × 3 cells around count. The result is [m, 2]: over all passes with such
    points, and over those of them that have also hit the point's own cell; 0 where there are none.
    """
    neighbours = _occupied(neighbour_keys(cell_key), cell_key)
    farthest = np.zeros((len(of), 2))
    for other in np.unique(passes):
        index = np.flatnonzero(passes == other)
        # One more cell at the end, always empty, is what absent neighbours (-1) point to.
        count = np.bincount(cell[index], minlength=len(cell_key) + 1)
        is_near = (count[neighbours] > 0).any(axis=1)
        asked = np.flatnonzero(is_near[cell[of]] & (passes[of] != other))
        query = of[asked]
        # neither balanced nor compact: the points are sorted, and building takes half of the time
        tree = cKDTree(points[index], balanced_tree=False, compact_nodes=False)
        nearest, which = tree.query(points[query])
        # the nearest of all may lie beyond the cells around, at the edge of a swath
        beyond = (neighbours[cell[query]] != cell[index[which]][:, None]).all(axis=1)
        nearest[beyond] = _nearest_in_cells(
            points[query[beyond]], neighbours[cell[query[beyond]]], points[index], count
        )
        in_cell = np.where(count[cell[query]] > 0, nearest, 0)
        farthest[asked] = np.maximum(farthest[asked], np.column_stack([nearest, in_cell]))
    return farthest


def _nearest_in_cells(
    query: np.ndarray, cells: np.ndarray, points: np.ndarray, count: np.ndarray
) -> np.ndarray:
    """Return the distance [m] from each of query [m, 3] to the nearest point in its cells [m, 9].

    Points [n, 3] are sorted by cell, count [C + 1] in each. All are searched, one of every cell at
    a time.
    """
    first = np.cumsum(count) - count
    nearest = np.full(len(query), np.inf)
    for rank in range(count[cells].max(initial=0)):
        asked, column = np.nonzero(count[cells] > rank)
        candidate = points[first[cells[asked, column]] + rank]
        np.minimum.at(nearest, asked, np.linalg.norm(query[asked] - candidate, axis=1))
    return nearest


def _occupied(keys: np.ndarray, cell_key: np.ndarray) -> np.ndarray:
    """Return the index into the sorted cell_key of each key, -1 where that cell is empty."""
    index = np.minimum(np.searchsorted(cell_key, keys), len(cell_key) - 1)
    return np.where(cell_key[index] == keys, index, -1)


def _sort_and_thin(points, passes, settings, rng):
    """Sort by cell and pass; drop at random what is above the caps."""
    points, passes = np.asarray(points, dtype=float), np.asarray(passes)
    keep = np.flatnonzero(np.isfinite(points).all(axis=1))
    if len(keep) > settings.max_beams:
        keep = np.sort(rng.choice(keep, settings.max_beams, replace=False))
    keys = cell_keys(points[keep, :2], settings.resolution_m)
    order = np.lexsort([rng.random(len(keep)), passes[keep], keys])
    keep, keys = keep[order], keys[order]
    is_first = np.ones(len(keep), dtype=bool)
    is_first[1:] = (np.diff(keys) != 0) | (np.diff(passes[keep]) != 0)
    start = np.maximum.accumulate(np.where(is_first, np.arange(len(keep)), 0))
    few = np.arange(len(keep)) - start < settings.max_points_per_cell
    return points[keep[few]], passes[keep[few]], keys[few]
