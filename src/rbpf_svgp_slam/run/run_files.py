"""The files of a run folder, from which every figure and metric can be made again.

trajectory.tum, online.tum, dead_reckoning.tum, ground_truth.tum: the pings' poses; map.npz: the map
on its grid, and the engine's own state; survey.npz: the pings' beams, and the covariances of the
first two; closures.npz: the loop closures; fixes.npz: the absolute positions, if any; history.npz:
the filter's status over time; time_lapse.npz: one particle's map as it grew; parameters.yaml: the
full parameter set.
report.json, report.html, seabed.npz and time_lapse.gif are made of these; what only the running
system knew stands in report.json alone.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import yaml
from scipy.interpolate import RegularGridInterpolator

from rbpf_svgp_slam.npz import READING_ERRORS
from rbpf_svgp_slam.run.aside import written_aside
from rbpf_svgp_slam.run.closures import Closures
from rbpf_svgp_slam.run.columns import Columns
from rbpf_svgp_slam.run.fixes import Fixes
from rbpf_svgp_slam.run.survey_run import GridMap, Predict, StoredMap, SurveyRun, TimeLapse
from rbpf_svgp_slam.run.tracks import interpolate_poses, read_tum, write_tum

# Array of map.npz, which has its name from the engine that was the first.
_SUPPORT_POINTS = "inducing_points"
_COVARIANCES = ("estimate_covariance", "online_covariance")
SEABED = "seabed.npz"
_MAY_LACK = ("online.tum", "ground_truth.tum", "closures.npz", "fixes.npz", "time_lapse.npz")
_Columns = TypeVar("_Columns", bound=Columns)
_TIME_LAPSE = ("t_s", "x", "y", "mean")
_STAMP_TOLERANCE_S = 1e-6  # TUM files hold nine decimals, doubles of today's stamps seven


class RunFolderError(ValueError):
    """A run folder lacks something that cannot be done without, or a file is damaged."""


def save_run(run: SurveyRun, folder: Path) -> None:
    """Write everything but the report, and put it into the folder when all of it is written."""
    with written_aside(folder, _MAY_LACK) as aside:
        _write_run(run, aside)


def _write_run(run: SurveyRun, out_dir: Path) -> None:
    write_tum(out_dir / "trajectory.tum", run.stamp_s, run.estimate)
    write_tum(out_dir / "dead_reckoning.tum", run.stamp_s, run.dead_reckoning)
    for name in ("online", "ground_truth"):
        if getattr(run, name) is not None:
            write_tum(out_dir / f"{name}.tum", run.stamp_s, getattr(run, name))
    _save_map(run, out_dir / "map.npz")
    if run.closures is not None:
        np.savez_compressed(out_dir / "closures.npz", **vars(run.closures))
    if run.fixes:
        np.savez_compressed(out_dir / "fixes.npz", **vars(run.fixes))
    covariances = {name: getattr(run, name) for name in _COVARIANCES}
    np.savez_compressed(
        out_dir / "survey.npz",
        stamp_s=run.stamp_s,
        held_out=run.held_out,
        beams_per_ping=np.bincount(run.ping_of_beam, minlength=len(run.stamp_s)),
        levelled=run.levelled.astype(np.float32),
        **{name: values for name, values in covariances.items() if values is not None},
    )
    np.savez_compressed(out_dir / "history.npz", **run.status_history)
    if run.time_lapse is not None:
        frames = {name: getattr(run.time_lapse, name) for name in _TIME_LAPSE}
        np.savez_compressed(out_dir / "time_lapse.npz", **frames)
    (out_dir / "parameters.yaml").write_text(yaml.safe_dump(run.config, sort_keys=True))


def save_seabed(run: SurveyRun, out_dir: Path) -> None:
    """Write seabed.npz, the seabed of the final trajectory; nothing where there is none."""
    path = out_dir / SEABED
    if run.seabed is None:
        return
    model = run.seabed_map.model
    np.savez_compressed(
        path,
        x=run.seabed.x,
        y=run.seabed.y,
        mean=run.seabed.mean,
        std=np.sqrt(run.seabed.variance),
        noise_std_m=np.sqrt(model.noise_variance_m2),
        lengthscale_m=model.lengthscale_m,
        outputscale_m2=model.outputscale_m2,
        spacing_m=model.spacing_m,
    )


def load_run(out_dir: str | Path, terrain: str | Path | None = None) -> SurveyRun:
    """The run that a folder holds; raises RunFolderError where that is not possible.

    survey.npz, trajectory.tum, dead_reckoning.tum and map.npz must be there, so that the run of
    another program can be scored too. terrain: the true seabed; by default report.json says where.
    """
    out_dir = Path(out_dir)
    survey = load_npz(out_dir / "survey.npz", ("stamp_s", "held_out", "beams_per_ping", "levelled"))
    stamp_s = survey["stamp_s"]
    grid, predict, extras = _load_map(out_dir / "map.npz")
    statistics = _statistics(out_dir)
    path = terrain or statistics.get("terrain")
    optional = {}
    for name in ("online", "ground_truth"):
        path_of = out_dir / f"{name}.tum"
        optional[name] = poses_at(path_of, stamp_s) if path_of.is_file() else None
    return SurveyRun(
        stamp_s=stamp_s,
        estimate=poses_at(out_dir / "trajectory.tum", stamp_s),
        dead_reckoning=poses_at(out_dir / "dead_reckoning.tum", stamp_s),
        closures=_load_columns(out_dir / "closures.npz", Closures),
        fixes=_load_columns(out_dir / "fixes.npz", Fixes),
        levelled=survey["levelled"].astype(float),
        ping_of_beam=np.repeat(np.arange(len(stamp_s)), survey["beams_per_ping"]),
        held_out=survey["held_out"].astype(bool),
        map=grid,
        predict=predict,
        terrain=load_terrain(path) if path else None,
        statistics=statistics,
        status_history=load_npz(out_dir / "history.npz", optional=True),
        time_lapse=_load_time_lapse(out_dir / "time_lapse.npz"),
        config=load_text(out_dir / "parameters.yaml", yaml.safe_load),
        **{name: survey.get(name) for name in _COVARIANCES},
        **optional,
        **extras,
    )


def _load_time_lapse(path: Path) -> TimeLapse | None:
    """None if there is no such file."""
    if not path.is_file():
        return None
    arrays = load_npz(path, _TIME_LAPSE)
    return TimeLapse(**{name: arrays[name] for name in _TIME_LAPSE})


def _load_columns(path: Path, kind: type[_Columns]) -> _Columns | None:
    """None if there is no such file: a run of another program, or from before there were any."""
    if not path.is_file():
        return None
    arrays = load_npz(path, kind.needed())
    return kind(**{name: arrays[name] for name in kind.names() if name in arrays})


def load_tracks(out_dir: str | Path) -> SurveyRun:
    """The trajectories alone of a folder, for one that holds no survey: a run without beams or map.

    trajectory.tum must be there, and its poses stand for the pings. Dead reckoning, the online
    estimate and the ground truth, NaN, None and None where there is no such file, are interpolated
    to their stamps, since they come at rates of their own. Raises RunFolderError or ValueError at
    what is missing or damaged.
    """
    out_dir = Path(out_dir)
    stamp_s, estimate = _track(out_dir / "trajectory.tum")
    others = {}
    for name in ("dead_reckoning", "online", "ground_truth"):
        path = out_dir / f"{name}.tum"
        others[name] = interpolate_poses(*_track(path), stamp_s) if path.is_file() else None
    if others["dead_reckoning"] is None:
        others["dead_reckoning"] = np.full((len(stamp_s), 6), np.nan)
    statistics = _statistics(out_dir)
    return SurveyRun(
        stamp_s=stamp_s,
        estimate=estimate,
        levelled=np.empty((0, 3)),
        ping_of_beam=np.empty(0, dtype=int),
        held_out=np.zeros(len(stamp_s), dtype=bool),
        map=GridMap(np.empty(0), np.empty(0), np.empty((0, 0))),
        predict=lambda xy: (np.full(len(xy), np.nan), np.full(len(xy), np.nan)),
        noise_variance_m2=np.nan,
        support_points=np.empty((0, 3)),
        statistics=statistics,
        config=load_text(out_dir / "parameters.yaml", yaml.safe_load),
        **others,
    )


def engine_predictor(engine: Any, origin_m: np.ndarray) -> Predict:
    """The predictions of a map engine, at positions [n, 2] in map."""
    return lambda xy: engine.predict(xy - origin_m)


def load_terrain(path: str | Path) -> GridMap | None:
    """The true seabed beside a simulated bag; none where there is no such file."""
    if not Path(path).is_file():
        return None
    file = load_npz(Path(path), ("z", "resolution_m", "origin_m"))
    z, resolution_m, origin_m = file["z"], float(file["resolution_m"]), file["origin_m"]
    x, y = (origin_m[i] + resolution_m * np.arange(z.shape[i]) for i in range(2))
    return GridMap(x, y, z.astype(float))


def _save_map(run: SurveyRun, path: Path) -> None:
    variance = np.full_like(run.map.mean, np.nan) if run.map.variance is None else run.map.variance
    stored = {}
    if run.stored_map is not None:
        stored = {
            "engine": run.stored_map.engine,
            "state": np.frombuffer(run.stored_map.state, dtype=np.uint8),
            "origin_m": run.stored_map.origin_m,
        }
    np.savez_compressed(
        path,
        x=run.map.x,
        y=run.map.y,
        mean=run.map.mean,
        variance=variance,
        noise_variance_m2=run.noise_variance_m2,
        **{_SUPPORT_POINTS: run.support_points},
        **stored,
    )


def _load_map(path: Path) -> tuple[GridMap, Predict, dict[str, Any]]:
    """The grid; what predicts, the engine where its state is there, else the grid; the rest."""
    file = load_npz(path, ("x", "y", "mean", "variance"))
    grid = GridMap(file["x"], file["y"], file["mean"], file["variance"])
    extras = {
        "noise_variance_m2": float(file.get("noise_variance_m2", 0.0)),
        "support_points": file.get(_SUPPORT_POINTS, np.empty((0, 3))),
        "support_label": _SUPPORT_POINTS.replace("_", " "),
    }
    if "state" not in file:
        return grid, _grid_predictor(grid), extras
    # Here, since a run of another program needs no engine's libraries.
    from rbpf_svgp_slam.maps import load_map

    stored = StoredMap(str(file["engine"]), file["state"].tobytes(), file["origin_m"])
    engine = load_map(stored.engine, stored.state)
    extras.update(stored_map=stored, support_label=engine.support_label)
    return grid, engine_predictor(engine, stored.origin_m), extras


def _grid_predictor(grid: GridMap) -> Predict:
    """Bilinear; NaN outside."""
    axes, options = (grid.x, grid.y), {"bounds_error": False, "fill_value": np.nan}
    mean, variance = (
        RegularGridInterpolator(axes, z, **options) for z in (grid.mean, grid.variance)
    )
    return lambda xy: (mean(xy), variance(xy))


def poses_at(path: Path, stamp_s: np.ndarray) -> np.ndarray:
    """Poses [P, 6] of the pings, NaN where the file has none."""
    written_s, poses = _track(path)
    result = np.full((len(stamp_s), 6), np.nan)
    if len(written_s):
        nearest = np.searchsorted(stamp_s, written_s - _STAMP_TOLERANCE_S)
        nearest = np.minimum(nearest, len(stamp_s) - 1)
        matches = np.abs(stamp_s[nearest] - written_s) <= _STAMP_TOLERANCE_S
        result[nearest[matches]] = poses[matches]
    return result


def _track(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Stamps [K] and poses [K, 6] of a file."""
    if not path.is_file():
        raise RunFolderError(f"{path}: no such file; expected the poses of the pings")
    return read_tum(path)


def load_npz(path: Path, names: tuple[str, ...] = (), optional=False) -> dict[str, np.ndarray]:
    """The arrays of a file, which must have those named; raises RunFolderError if it has not."""
    if not path.is_file():
        if optional:
            return {}
        raise RunFolderError(f"{path}: no such file; expected arrays {', '.join(names)}")
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
    except READING_ERRORS as error:
        raise RunFolderError(f"{path}: expected an npz file ({error})") from error
    missing = [name for name in names if name not in arrays]
    if missing:
        raise RunFolderError(f"{path}: expected arrays {', '.join(names)}; lacks {missing}")
    return arrays


def _statistics(out_dir: Path) -> dict[str, Any]:
    """What report.json says; of this what the data tell, too, is computed again."""
    report = load_text(out_dir / "report.json", json.loads)
    return {name: value for name, value in report.items() if name != "notes"}


def load_text(path: Path, parse: Any) -> dict[str, Any]:
    """A file of names and values; empty if there is none."""
    if not path.is_file():
        return {}
    try:
        return dict(parse(path.read_text(encoding="utf-8")) or {})
    except (ValueError, TypeError, yaml.YAMLError) as error:
        raise RunFolderError(f"{path}: expected names and values ({error})") from error
