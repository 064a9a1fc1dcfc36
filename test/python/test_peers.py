"""The study's peers: their maps, their filter, and that they make something of a survey."""

import dataclasses
import json

import numpy as np
import pytest

from bench.peers import __main__ as command
from bench.peers.exact_gp import ExactGp, GpModel, predict_for_particles
from bench.peers.grid_maps import BEAM_STD_M, LEAST_BEAMS, GridMaps
from bench.peers.histories import Histories, moved
from bench.peers.peer_runs import PEERS, peer_run
from bench.peers.tiled_gp import MARGIN_M, TILE_M, TiledGp
from bench.peers.weight_rule import Prediction, WeightRule, n_eff, systematic
from bench.smoothing import simulated_runs
from bench.study.replays import FIELDS
from rbpf_svgp_slam.metrics.trajectory_errors import ate_rmse
from rbpf_svgp_slam.run.planar_poses import relative_pose

RULE = WeightRule(0.3, 30.0, 4.0, 0.3, 4.0, 0.25, 0.5)


@pytest.fixture(scope="module")
def survey():
    """Some five minutes over relief, with drift that is worth correcting."""
    return simulated_runs.simulated_run("fractal relief with dunes", 6, 0.2, "demo")


@pytest.fixture
def histories(survey):
    """Three particles, each of which has gone its own way."""
    histories = Histories(survey, 3)
    dead_reckoning = survey.dead_reckoning[:, None, [0, 1, 5]]
    off = np.random.default_rng(1).normal(0, (2.0, 2.0, 0.05), (3, 3))
    histories.poses[:] = dead_reckoning + off
    return histories


def test_a_step_is_what_relative_pose_says():
    rng = np.random.default_rng(0)
    older, younger = rng.normal(size=(2, 5, 3))
    np.testing.assert_allclose(moved(older, relative_pose(older, younger)), younger, atol=1e-12)


def test_the_mean_of_histories_crosses_the_date_line_of_headings(histories):
    histories.poses[0] = [[0, 0, np.pi - 0.1], [2, 0, 0.1 - np.pi], [9, 9, 9]]
    histories.weights = np.array([0.25, 0.75, 0.0])
    mean, covariance = histories.mean_and_covariance(np.array([0]))
    np.testing.assert_allclose(mean[0], [1.5, 0, np.pi + 0.05])
    # Deviations of -1.5 m with weight 1/4 and 0.5 m with 3/4, of -0.15 and 0.05 rad.
    np.testing.assert_allclose(covariance[0], [0.75, 0, 0.075, 0, 0, 0.0075], atol=1e-12)


def test_cells_of_a_grid_have_their_beams_mean(histories):
    pings = np.arange(400)
    placed_m = histories.levelled[:, :2]
    grid = GridMaps(histories, placed_m.min(axis=0) - 100, placed_m.max(axis=0) + 300)
    for some in np.array_split(pings, 7):
        grid.learn(some)
    beams = np.flatnonzero(histories.ping_of_beam < 400)
    for j, xy_m in enumerate(histories.placed(beams)):
        cells = np.floor(xy_m - grid._low_m).astype(int)
        where, of_beam = np.unique(cells, axis=0, return_inverse=True)
        count = np.bincount(of_beam)
        mean_m = np.bincount(of_beam, histories.levelled[beams, 2]) / count
        assert grid.count[j].sum() == len(beams)
        np.testing.assert_array_equal(grid.count[j][tuple(where.T)], count)
        # Running means in float32, of depths of 40 m: some rounding errors of 4e-6 m.
        np.testing.assert_allclose(grid.mean_m[j][tuple(where.T)], mean_m, atol=1e-4)
    predicted = grid.predict(beams[:50])
    assert predicted.mapped.mean() > 0.8  # a cell has 8 beams of these on average
    np.testing.assert_allclose(
        predicted.variance_m2[predicted.mapped].max(), BEAM_STD_M**2 / LEAST_BEAMS, rtol=1e-6
    )
    before = grid.mean_m.copy()
    grid.resample(np.array([2, 2, 0]))
    np.testing.assert_array_equal(grid.mean_m, before[[2, 2, 0]])


def test_a_ping_far_from_the_grid_is_not_mapped(histories):
    grid = GridMaps(histories, np.zeros(2), np.ones(2))
    histories.poses[:] = [1000.0, -1000.0, 0.0]
    grid.learn(np.arange(20))
    assert grid.count.sum() == 0
    assert not grid.predict(histories.beams_of(30, 60)).mapped.any()


def test_weights_go_to_who_predicts_the_ping():
    z_m, mapped = np.zeros(4), np.ones((3, 4), dtype=bool)
    mean_m = np.array([[0.0] * 4, [0.6] * 4, [9.0] * 4])
    mapped[2, 1:] = False  # one vote of four is more than half of min_overlap
    prediction = Prediction(mean_m, np.full((3, 4), 0.27), mapped)
    got = RULE.log_likelihood(z_m, prediction)
    # The rule's formula: squares over 0.3^2 + 0.27, nine of twelve votes.
    squares = np.array([0.0, 0.36, 81.0]) / 0.36
    np.testing.assert_allclose(got, -30 * 0.75 * 2.5 * np.log1p(squares / 4))
    weights = RULE.updated(np.full(3, 1 / 3), got)
    assert weights[0] > weights[1] > weights[2]


def test_who_has_no_map_is_neither_believed_nor_blamed():
    mapped = np.array([[True] * 4, [True] * 4, [True] * 4, [False] * 4])
    mean_m = np.array([[0.0], [0.3], [0.6], [0.0]]) * np.ones(4)
    got = RULE.log_likelihood(np.zeros(4), Prediction(mean_m, np.zeros((4, 4)), mapped))
    assert got[3] == got[1]
    nowhere = Prediction(mean_m, np.zeros((4, 4)), mapped & False)
    assert RULE.log_likelihood(np.zeros(4), nowhere) is None
    unlike_all = Prediction(mean_m + 9.0, np.zeros((4, 4)), mapped)
    assert RULE.log_likelihood(np.zeros(4), unlike_all) is None


def test_no_ping_decides_alone():
    weights = RULE.updated(np.full(40, 1 / 40), -np.arange(40.0) * 100)
    assert n_eff(weights) == pytest.approx(0.25 * 40, rel=1e-6)
    assert weights.sum() == pytest.approx(1) and RULE.asks_for_resampling(weights)


def test_offspring_are_as_many_as_weights_say():
    rng = np.random.default_rng(2)
    weights = rng.dirichlet(np.ones(50))
    count = np.bincount(systematic(weights, rng), minlength=50)
    assert (np.abs(count - 50 * weights) < 1).all()  # systematic: rounded up or down


def test_a_gp_is_the_textbooks():
    rng = np.random.default_rng(3)
    xy_m, at_m = rng.uniform(0, 20, (40, 2)), rng.uniform(0, 20, (7, 2))
    z_m = np.sin(xy_m[:, 0] / 4) - 30
    model = GpModel(0.7, 6.0, 0.01)
    mean_m, variance_m2 = ExactGp(model, xy_m, z_m).predict(at_m)
    # Rasmussen and Williams (2006), equations 2.25 and 2.26.
    inverse = np.linalg.inv(model.kernel(xy_m, xy_m) + 0.01 * np.eye(40))
    cross = model.kernel(at_m, xy_m)
    np.testing.assert_allclose(mean_m, z_m.mean() + cross @ inverse @ (z_m - z_m.mean()))
    np.testing.assert_allclose(variance_m2, 0.7 - np.diag(cross @ inverse @ cross.T), atol=1e-12)
    better = model.learned(xy_m, z_m)
    assert better.log_evidence(xy_m, z_m) > model.log_evidence(xy_m, z_m)


def test_particles_of_one_history_share_what_each_would_have_found():
    rng = np.random.default_rng(4)
    beams_m = rng.uniform(0, 20, (2, 40, 2))[[0, 1, 0, 0]]
    z_m, xy_m = rng.normal(size=40), rng.uniform(0, 20, (4, 7, 2))
    asked = rng.random((4, 7)) < 0.7
    got = predict_for_particles(GpModel(), beams_m, z_m, xy_m, asked)
    for j in range(4):
        alone = ExactGp(GpModel(), beams_m[j], z_m).predict(xy_m[j])
        # As many right-hand sides at once are summed in another order.
        np.testing.assert_allclose(got[0][j], np.where(asked[j], alone[0], 0), atol=1e-9)
        np.testing.assert_allclose(got[1][j], np.where(asked[j], alone[1], 0), atol=1e-9)


def test_tiles_have_the_beams_of_their_margins(histories):
    tiles = TiledGp(histories)
    for first in range(0, 200, 20):
        tiles.learn(np.arange(first, first + 20))
    (corner, tile) = max(tiles._tiles.items(), key=lambda item: len(item[1].beams))
    off_m = histories.placed_by_mean(tile.beams) - TILE_M * np.array(corner)
    assert off_m.min() >= -MARGIN_M and off_m.max() < TILE_M + MARGIN_M
    assert off_m.min() < 0 and off_m.max() > TILE_M
    assert len(np.unique(np.floor(off_m), axis=0)) == len(off_m)  # one in each cell of 1 m


@pytest.mark.parametrize("name", PEERS)
def test_a_peer_is_better_than_dead_reckoning_and_repeats_itself(survey, name):
    run = peer_run(name, survey, 1, particles=20)
    dr_m = ate_rmse(survey.dead_reckoning, survey.ground_truth)
    # They reach 0.36 to 0.61 of it on this survey; without maps it would be all of it.
    assert ate_rmse(run.online, survey.ground_truth) < 0.8 * dr_m
    again = peer_run(name, survey, 1, particles=20)
    if name.startswith("gp_"):
        # Of GPs the last digits are not always the same, with one thread neither, and what that
        # changes grows from prompt to prompt: by up to 4e-4 m in the end, enough for another
        # particle to be drawn once in a while. Up to here it has had less time to grow:
        half = len(survey.stamp_s) // 2
        np.testing.assert_allclose(again.online[:half], run.online[:half], rtol=0, atol=0.05)
    else:
        np.testing.assert_array_equal(again.estimate, run.estimate)
        np.testing.assert_array_equal(again.online, run.online)


def test_a_report_has_the_studys_fields(survey, tmp_path, monkeypatch):
    few = dataclasses.replace(survey)
    monkeypatch.setattr(command, "as_run", lambda _: few)
    monkeypatch.setattr(command, "peer_run", lambda *what: peer_run(*what, particles=5))

    class AnyCase:
        survey = staticmethod(lambda seed: None)

    monkeypatch.setattr(command, "cases", lambda names: [AnyCase])
    command.main("grid", "base", "1", str(tmp_path))
    report = json.loads((tmp_path / "report.json").read_text())
    lacking = {name for name in FIELDS if report.get(name) is None}
    # No closures, no founders told, and no one map that held-out beams could be held against.
    assert lacking == set(
        "closures_accepted closures_refused closures_wrong founders smoothing_s "
        "map_rmse_m grid_rmse_m".split()
    )
    assert (tmp_path / "trajectory.tum").is_file() and (tmp_path / "online.tum").is_file()
