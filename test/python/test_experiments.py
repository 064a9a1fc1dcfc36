"""The paper's experiments: what is planned, run and written."""

import json
import math
import subprocess
import sys

import numpy as np
import pytest
import rospkg
import yaml

from rbpf_svgp_slam.experiments import ExperimentError, experiment_command, plan, runner, summary
from rbpf_svgp_slam.experiments.resources import Usage
from rbpf_svgp_slam.simulation.mission import MISSIONS

SURVEY = {"survey_area": [[0, 0], [9, 0], [9, 9]], "motion": {"surge_std_m": 0.1}}


def parameters(name, row, **options):
    experiment = plan.experiment(name)
    rows = {row.name: row for row in experiment.configurations}
    return plan.run_parameters(experiment, rows[row], plan.Options(**options), SURVEY, 1000.0)


def test_the_papers_rows_are_there_with_its_numbers():
    rows = {row.name: row.paper for row in plan.experiment("exp1").configurations if row.paper}
    assert rows == {
        "J1_B1": {"iterations_per_particle": 202_327, "map_consistency_rmse_m": 1.636},
        "J10_B1": {"iterations_per_particle": 21_425, "map_consistency_rmse_m": 1.709},
        "J10_B10": {"iterations_per_particle": 39_373, "map_consistency_rmse_m": 1.712},
        "J100_B10": {"iterations_per_particle": 3_714, "map_consistency_rmse_m": 1.995},
    }
    (live,) = runner._chosen(plan.experiment("exp2"), plan.Options())
    assert (live.name, live.paper) == ("J80_B8", {"iterations_per_particle": 2_965})
    assert [row.name for row in runner._chosen(plan.experiment("exp3"), plan.Options())] == [
        "J100_B10"
    ]


@pytest.mark.parametrize("cores", [1, 2, 10, 64])
def test_there_is_a_row_with_as_many_nodes_as_cores(cores):
    rows = plan._mapping_rows(cores)
    assert (100, min(cores, 100)) in {(row.particles, row.nodes) for row in rows}
    assert all(row.nodes <= row.particles for row in rows)
    assert len({row.name for row in rows}) == len(rows)
    assert sum(bool(row.paper) for row in rows) == 4


@pytest.mark.parametrize("name", ["exp1", "exp2", "exp3"])
def test_every_mission_exists_and_is_the_experiments_own(name):
    experiment = plan.experiment(name)
    assert experiment.mission.endswith(name[-1]) and experiment.mission in MISSIONS
    assert experiment.figures_of in [row.name for row in experiment.configurations]


def test_mapping_has_no_motion_noise_whatever_the_survey_says():
    merged = parameters("exp1", "J10_B1", seed=7)
    assert merged["motion"] == {"surge_std_m": 0.0, "sway_std_m": 0.0, "yaw_std_rad": 0.0}
    assert merged["lc"]["rate_hz"] == 0.0
    assert merged["survey_area"] == SURVEY["survey_area"]
    assert (merged["particles"], merged["nodes"], merged["seed"]) == (10, 1, 7)
    assert merged["svgp"]["inducing_points"] == 400
    assert parameters("exp3", "J100_B10")["motion"] == SURVEY["motion"]


def test_adam_gets_the_papers_steps_and_teachers_their_own():
    # steps of all maps over 1,000 s of survey
    adam = parameters("exp1", "J10_B1", optimizer="adam", scale=0.1)["offline"]
    assert adam["steps_per_second"] * 1000.0 / 10 == pytest.approx(2142.5)
    for row, nodes in (("J10_B1", 1), ("J100_B10", 10)):
        streaming = parameters("exp1", row)["offline"]["steps_per_second"]
        assert streaming / nodes == plan.experiment("exp1").teacher_steps_per_s


def test_the_engine_is_an_axis():
    exp3 = plan.experiment("exp3")
    of_gmrf = runner._chosen(exp3, plan.Options(engines=("gmrf",)))
    assert [(row.particles, row.engine) for row in of_gmrf] == [(100, "gmrf"), (1000, "gmrf")]
    both = runner._chosen(exp3, plan.Options(engines=("svgp", "gmrf")))
    assert [row.name for row in both] == ["J100_B10", *(row.name for row in of_gmrf)]
    assert runner._chosen(exp3, plan.Options(only=(of_gmrf[1].name,))) == [of_gmrf[1]]
    merged = parameters("exp3", of_gmrf[1].name)
    assert (merged["map"]["engine"], merged["particles"]) == ("gmrf", 1000)
    assert merged["lc"]["rate_hz"] == 0.1  # the experiment's, as for the SVGP's rows


def test_the_users_overlay_is_on_top_and_leaves_the_rest():
    merged = parameters("exp3", "J100_B10", overlay={"svgp": {"inducing_points": 64}, "seed": 3})
    assert merged["svgp"]["inducing_points"] == 64 and merged["seed"] == 3
    assert merged["svgp"]["minibatch_size"] == 1000


def test_merging_does_not_change_what_is_merged():
    base = {"svgp": {"a": 1}}
    assert plan.merged(base, {"svgp": {"b": 2}}) == {"svgp": {"a": 1, "b": 2}}
    assert base == {"svgp": {"a": 1}}


@pytest.mark.parametrize(
    "arguments, message",
    [
        (["exp4"], "experiment is 'exp4', expected one of exp1, exp2, exp3"),
        (["exp1", "--only", "J7_B7"], "configuration is 'J7_B7', expected one of J1_B1"),
        (["exp1", "--config", "no.yaml"], "no.yaml"),
        (["exp1", "--only", "J1_B1", "--scale", "-1"], "simulating failed"),
        (["exp2", "--rate", "0"], "rate is 0.0, expected a number above 0"),
        (["exp2", "--rate", "nan"], "rate is nan, expected a number above 0"),
    ],
)
def test_mistakes_are_told_in_one_line(arguments, message, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(
        runner.subprocess, "run", lambda *_, **__: subprocess.CompletedProcess([], 2)
    )
    assert experiment_command.main([*arguments, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1


def test_a_live_experiment_can_be_read_directly(tmp_path, monkeypatch):
    def run_experiment(how, options, out_dir):
        plans.append(how)
        raise experiment_command.ExperimentError("that is all")

    plans = []
    monkeypatch.setattr(experiment_command, "run_experiment", run_experiment)
    for more in ([], ["--offline"]):
        assert experiment_command.main(["exp2", *more, "--out", str(tmp_path)]) == 2
    assert [(how.live, how.other_load > 0) for how in plans] == [(True, True), (False, False)]


def test_an_overlay_that_is_no_set_of_parameters_is_named(tmp_path, capsys):
    for text in ("- 1\n", "a: [\n"):
        path = tmp_path / "mine.yaml"
        path.write_text(text)
        assert experiment_command.main(["exp1", "--config", str(path), "--out", str(tmp_path)]) == 2
        assert "mine.yaml" in capsys.readouterr().err


def test_an_overlays_unknown_names_are_told_before_anything_is_done(tmp_path, capsys):
    path = tmp_path / "mine.yaml"
    path.write_text("particles: 3\nlc: {rate_hz: 0.1, rate: 2}\n")
    assert (
        experiment_command.main(["exp1", "--config", str(path), "--out", str(tmp_path / "out")])
        == 2
    )
    assert "mine.yaml: lc/rate is unknown" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_another_survey_is_not_simulated_over_the_first(tmp_path, monkeypatch):
    simulated = []
    monkeypatch.setattr(
        runner.subprocess,
        "run",
        lambda command, **_: simulated.append(command) or subprocess.CompletedProcess(command, 0),
    )
    experiment = plan.experiment("exp3")
    for _ in range(2):
        runner._simulate(experiment, plan.Options(scale=0.1), tmp_path)
    assert len(simulated) == 1
    with pytest.raises(ExperimentError, match="--seed 1', expected .*--seed 2': choose another"):
        runner._simulate(experiment, plan.Options(scale=0.1, seed=2), tmp_path)
    with pytest.raises(ExperimentError, match="lolo3 .*expected .* lolo2"):
        runner._simulate(plan.experiment("exp2"), plan.Options(scale=0.1), tmp_path)
    assert len(simulated) == 1
    # Moved elsewhere it is the same survey.
    moved = tmp_path.rename(tmp_path.with_name("moved"))
    assert runner._simulate(experiment, plan.Options(scale=0.1), moved) == moved / "survey.bag"
    assert len(simulated) == 1


def test_the_first_error_of_a_launch_is_told(tmp_path):
    log = tmp_path / "launch.log"
    log.write_text("started\n\x1b[31m[FATAL] [1.5]: lc/rate_hz is fast\x1b[0m\n[ERROR] later\n")
    assert runner._first_error(log) == ": [FATAL] [1.5]: lc/rate_hz is fast"
    log.write_text("started\n")
    assert runner._first_error(log) == ""


def test_it_is_told_how_far_a_run_is(tmp_path, monkeypatch):
    log = tmp_path / "launch.log"
    # Says two things at a time, as replays do, and ends once both have been told.
    says = """
import sys
for share in (10, 20):
    lines = f"\\rreplay {share} %, 7 pings \\rreplay {share + 1} %, 8 pings "
    print(lines, end="", flush=True)
    sys.stdin.readline()
sys.exit(3)
"""
    with log.open("w") as output:
        process = subprocess.Popen(
            [sys.executable, "-c", says], stdin=subprocess.PIPE, stdout=output, text=True
        )
    told = []

    def hear(text, **_):
        if text not in told:
            told.append(text)
            process.stdin.write("\n")
            process.stdin.flush()

    monkeypatch.setattr(runner, "print", hear, raising=False)
    assert runner._wait(process, log, period_s=0.05) == 3
    assert told == ["  replay 11 %, 8 pings", "  replay 21 %, 8 pings"]


def test_a_run_is_done_only_if_its_settings_are_the_same(tmp_path):
    settings = json.loads(json.dumps({"scale": 1.0, "parameters": {"seed": 1}}))
    assert not runner._is_done(tmp_path, settings)
    (tmp_path / runner.SETTINGS).write_text(json.dumps({"settings": settings, "commit": "abc"}))
    assert not runner._is_done(tmp_path, settings)  # no report
    (tmp_path / "report.json").write_text("{}")
    assert runner._is_done(tmp_path, settings)
    other = {"parameters": {"seed": 2, "svgp": {"optimizer": "adam"}}, "scale": 0.5}
    with pytest.raises(
        ExperimentError, match=r"\(parameters/seed, parameters/svgp/optimizer, scale\): choose"
    ):
        runner._is_done(tmp_path, other)


# --- summary


def finished(tmp_path, row, particles=None, **report):
    folder = tmp_path / row.name
    folder.mkdir()
    (folder / "report.json").write_text(json.dumps(report))
    machine = {"cores": 2, "cpu": "Some CPU", "memory_gb": 24.0}
    sizes = {"particles": particles or row.particles, "nodes": row.nodes}
    settings = {"scale": 1.0, "seed": 1, "parameters": sizes}
    facts = {"settings": settings, "machine": machine, "commit": "abc123"}
    (folder / runner.SETTINGS).write_text(json.dumps(facts))
    nodes = {"map nodes": np.array([1.0, 2.0])}
    Usage(np.arange(2.0), nodes, {"map nodes": np.array([300.0, 400.0])}).save(
        folder / runner.RESOURCES
    )
    return folder


def test_the_summary_has_the_papers_numbers_below_ours(tmp_path):
    experiment = plan.experiment("exp1")
    paper = [row for row in experiment.configurations if row.paper][:2]
    reports = [
        {"iterations_per_particle": 8000.0, "map_rmse_m": 0.5, "sampled_map_rmse_m": {"mean": 0.4}},
        {"iterations_per_particle": 900.0, "map_rmse_m": None, "sampled_map_rmse_m": None},
    ]
    folders = [finished(tmp_path, row, **report) for row, report in zip(paper, reports)]
    rows = summary.read_rows(experiment, folders)
    figure = tmp_path / "figures" / "elbo.png"
    text = summary.write_summary(experiment, rows, [figure], tmp_path).read_text()
    assert "| steps per particle | 8\u202f000 | 900 |" in text
    assert "| *the paper's Adam steps per particle* | 202\u202f327 | 21\u202f425 |" in text
    assert "| map RMSE at held-out beams, m | 0.5 | – |" in text
    assert "| the same, mean of up to 10 particles' maps | 0.4 | – |" in text
    assert "| map nodes | 1.50, 400 MB | 1.50, 400 MB |" in text
    assert "abc123" in text and "Some CPU" in text
    assert "![elbo](figures/elbo.png)" in text
    assert "| *the paper's consistency RMSE, m* | 1.636 | 1.709 |" in text
    # what no run has is left out
    assert "ATE" not in text


def test_a_run_of_another_j_is_not_put_beside_the_papers(tmp_path):
    experiment = plan.experiment("exp1")
    row = next(row for row in experiment.configurations if row.name == "J100_B10")
    rows = summary.read_rows(
        experiment, [finished(tmp_path, row, particles=40, iterations_per_particle=900.0)]
    )
    text = summary.write_summary(experiment, rows, [], tmp_path).read_text()
    assert "J = 40, B = 10" in text and "J = 100" not in text
    assert "paper" not in text


def test_shipped_parameters_accept_every_experiments_names():
    """An experiment that sets a parameter that does not exist would stop the start."""
    package = rospkg.RosPack().get_path("rbpf_svgp_slam")
    with open(f"{package}/config/default.yaml", encoding="utf-8") as file:
        known = yaml.safe_load(file)
    for name in ("exp1", "exp2", "exp3"):
        experiment = plan.experiment(name)
        for row in experiment.configurations:
            merged = parameters(name, row.name)
            for group, value in merged.items():
                assert group in known
                if isinstance(value, dict):
                    assert set(value) <= set(known[group])
            assert math.isfinite(merged["offline"]["steps_per_second"])
