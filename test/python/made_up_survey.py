"""A made-up survey with known errors, for the tests of metrics, reports and figures."""

import dataclasses

import numpy as np

from rbpf_svgp_slam.evaluation.report import write_report
from rbpf_svgp_slam.run.closures import Closures
from rbpf_svgp_slam.run.run_files import save_run
from rbpf_svgp_slam.run.survey_run import GridMap, SurveyRun

NOISE_M = 0.1
#: Latitude and longitude of map's origin, where it is given one.
ORIGIN_DEG = [57.5, 11.2]
# Sums of doubles of order 100 m: a few thousand roundings of 1e-14 m.
ROUNDING_M = 1e-9


def seabed(xy):
    """Ripples and a mound, z in m [n] at xy [n, 2] m."""
    x, y = np.asarray(xy, dtype=float).T
    mound = 4 * np.exp(-((x - 60) ** 2 + (y - 25) ** 2) / 300)
    return -25 + mound + 0.7 * np.sin(x / 2.5) * np.cos(y / 3)


def lawn_mower(lines=6, length_m=100.0, spacing_m=10.0, step_m=0.75):
    """Poses [P, 6] every step_m along parallel lines joined by half circles, at z = -10 m."""
    pieces = []
    arc = np.linspace(-np.pi / 2, np.pi / 2, int(np.pi * spacing_m / 2 / step_m))[1:-1]
    radius_m = spacing_m / 2
    for i in range(lines):
        x = np.arange(0, length_m, step_m)
        straight = np.column_stack([x, np.full(len(x), i * spacing_m)])
        turn = np.column_stack([length_m + radius_m * np.cos(arc), radius_m * np.sin(arc)])
        turn[:, 1] += (i + 0.5) * spacing_m
        line = np.vstack([straight, turn]) if i < lines - 1 else straight
        pieces.append(line if i % 2 == 0 else line * [-1, 1] + [length_m, 0])
    xy = np.vstack(pieces)
    poses = np.zeros((len(xy), 6))
    poses[:, :2], poses[:, 2] = xy, -10
    poses[:, 5] = np.arctan2(*np.gradient(xy, axis=0).T[::-1])
    return poses


def place(poses, offsets_m, z):
    """Beams [P·K, 3]: across-track offsets [K] turned and moved by the poses [P, 6]."""
    yaw = poses[:, 5:]
    x = poses[:, :1] - np.sin(yaw) * offsets_m
    y = poses[:, 1:2] + np.cos(yaw) * offsets_m
    return np.column_stack([x.ravel(), y.ravel(), z])


def predict_seabed(xy):
    return seabed(xy) + 0.05 * np.sin(xy[:, 0]), np.full(len(xy), 0.05**2)


def make_map():
    x, y = np.arange(-12, 113, 1.0), np.arange(-14, 65, 1.0)
    points = np.stack(np.meshgrid(x, y, indexing="ij"), -1).reshape(-1, 2)
    mean, variance = (values.reshape(len(x), len(y)) for values in predict_seabed(points))
    outside = (x < -8)[:, None] | (y > 60)
    edge = np.clip(np.abs(points[:, 1] - 25) - 32, 0, None).reshape(len(x), len(y))
    mean, variance = np.where(outside, np.nan, mean), np.where(outside, np.nan, variance)
    return GridMap(x, y, mean, variance + 0.02 * edge)


def make_terrain():
    x, y = np.arange(-30, 130, 0.5), np.arange(-30, 80, 0.5)
    points = np.stack(np.meshgrid(x, y, indexing="ij"), -1).reshape(-1, 2)
    return GridMap(x, y, seabed(points).reshape(len(x), len(y)))


def make_history(t_s, duration_s):
    phase = (t_s - t_s[0]) / duration_s
    return {
        "t_s": t_s,
        "n_eff": 100 * (1 - (phase * 5) % 1 * 0.55),
        "loop_closure_prompts": np.floor(phase * 60),
        "resamplings": np.floor(phase * 5),
        "iterations_total": 90_000 * phase,
        "elbo": -3 + 2.5 * (1 - np.exp(-phase * 6)),
    }


def covariances(std_m):
    """Upper triangles [P, 6] for standard deviations of x and y [P, 2] m, and 0.01 rad of yaw."""
    upper = np.zeros((len(std_m), 6))
    upper[:, [0, 3]], upper[:, 5] = std_m**2, 0.01**2
    return upper


def make_closures(rng, stamp_s, truth):
    """Sixteen closures between neighbouring lines, two of them 3 m wrong and three refused."""
    line = len(stamp_s) // 6
    older = rng.integers(0, len(stamp_s) - line, 16)
    younger = older + line
    sigma = np.array([0.2, 0.2, 0.01])
    x, y, yaw = 0, 1, 5
    d = truth[younger] - truth[older]
    cos, sin = np.cos(truth[older, yaw]), np.sin(truth[older, yaw])
    true = [cos * d[:, x] + sin * d[:, y], cos * d[:, y] - sin * d[:, x], d[:, yaw]]
    relative = np.column_stack(true) + sigma * rng.standard_normal((16, 3))
    relative[:2, 0] += 3.0
    verdict = np.array(["accepted"] * 13 + ["flat", "flat", "bad_fit"])
    return Closures(
        stamp=stamp_s[younger],
        stamp_older=stamp_s[older],
        relative=relative,
        covariance=np.tile([0.2**2, 0, 0, 0.2**2, 0, 0.01**2], (16, 1)),
        shift=rng.standard_normal((16, 3)) * [1.0, 1.0, 0.01],
        rms_m=rng.uniform(0.1, 0.2, 16),
        beams=rng.integers(500, 900, 16),
        weight=np.where(verdict == "accepted", 1.0, np.nan),
        verdict=verdict,
    )


#: What a run has for each ping, for tests that cut a survey short.
OF_PINGS = (
    "stamp_s estimate estimate_covariance online online_covariance dead_reckoning ground_truth "
    "held_out"
).split()


def make_run(seed=0):
    """A survey of six lines whose DR drifts by up to 6 m, and whose estimate errs by 0.5 m."""
    rng = np.random.default_rng(seed)
    truth = lawn_mower()
    phase = np.linspace(0, 1, len(truth))[:, None]
    drift, wander = np.zeros_like(truth), np.zeros_like(truth)
    drift[:, :2] = phase**1.5 * [4.5, -4.0]
    wander[:, :2] = 0.5 * np.sin(phase * [[9.0, 14.0]])
    offsets_m = np.linspace(-12, 12, 40)
    footprints = place(truth, offsets_m, np.zeros(len(truth) * len(offsets_m)))
    z = seabed(footprints[:, :2]) + NOISE_M * rng.standard_normal(len(footprints))
    stamp_s = 1.6e9 + 0.5 * np.arange(len(truth))
    x, y = np.meshgrid(np.arange(-10, 110, 10.0), np.arange(-12, 62, 10.0))
    duration_s = float(stamp_s[-1] - stamp_s[0])
    statistics = dict(
        particles=100, nodes=2, seed=seed, pings=len(truth), pings_dropped=0, wall_s=150.0
    )
    statistics.update(beams=len(z), duration_s=duration_s, iterations_total=90_000)
    statistics.update(loop_closure_prompts=60, resamplings=5, founders=1, smoothing_s=5.4)
    statistics["health"] = {"pings_dropped": 0, "refused": {"pings/no_beams": 3}, "journal": "kept"}
    statistics["peak_rss_mb"] = {"rbpf_core": 210.4, "svgp_node_0": np.float32(812.5)}
    return SurveyRun(
        stamp_s=stamp_s,
        estimate=truth + wander,
        estimate_covariance=covariances(0.05 + np.abs(wander[:, :2]) * 0.5 + 0.2 * phase),
        online=truth + 2 * wander,
        online_covariance=covariances(0.1 + np.abs(wander[:, :2]) + 0.4 * phase),
        closures=make_closures(rng, stamp_s, truth),
        dead_reckoning=truth + drift,
        ground_truth=truth,
        levelled=np.column_stack([np.zeros(len(z)), np.tile(offsets_m, len(truth)), z]),
        ping_of_beam=np.repeat(np.arange(len(truth)), len(offsets_m)),
        held_out=np.arange(len(truth)) % 10 == 5,
        map=make_map(),
        predict=predict_seabed,
        noise_variance_m2=NOISE_M**2,
        support_points=np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]),
        support_label="inducing points",
        statistics=statistics,
        status_history=make_history(stamp_s[::10], duration_s),
        terrain=make_terrain(),
        config={"particles": 100, "svgp": {"inducing_points": 96, "kernel": "matern12"}},
    )


def without(run, **changes):
    return dataclasses.replace(run, **changes)


def write_run(run, folder, figures=False):
    """The whole run folder, as the recorder writes it; returns the report."""
    save_run(run, folder)
    return write_report(run, folder, figures=figures)


def random_tracks(rng, pings=60):
    """Poses and truth [P, 6] at any attitude; truth is unknown at a gap and at the end."""
    poses, truth = rng.normal(0, 1, (2, pings, 6)) * [20, 20, 5, 0.5, 0.5, 2]
    truth[10:14] = np.nan
    truth[-1] = np.nan
    return poses, truth
