"""The study of what the data allow: its cases, its tables, and that it goes on where it was."""

import dataclasses
import itertools
import json

import numpy as np
import pytest
from matplotlib.figure import Figure

from bench.study import __main__ as command
from bench.study import cases, compare, contestants, figure8, figures, relief, replays, tables
from bench.study.targets import against_targets
from rbpf_svgp_slam.parameters.known import complaints, default_parameters
from rbpf_svgp_slam.run.run_files import save_run
from rbpf_svgp_slam.simulation.mission import get_mission, plan_waypoints


def test_cases_are_named_by_what_differs_from_the_base():
    assert len(cases.ALL) == 6 * 3 * 3 * 4 == len({case.name for case in cases.ALL})
    assert [case.name for case in cases.ONE_AT_A_TIME].count("base") == 1
    assert len(cases.cases(["single"])) == 1 + 5 + 2 + 2 + 3
    [case] = cases.cases(["rippled+cheap"])
    assert (case.seabed, case.dead_reckoning, case.lines) == ("rippled", "cheap", "crossed")
    with pytest.raises(ValueError, match="case is 'cheap.rippled', expected base, all, pairs,"):
        cases.cases(["base", "cheap+rippled"])


def test_in_a_ninth_of_the_cases_any_two_levels_meet():
    assert len(cases.cases(["pairs"])) == 24
    factors = (cases.SEABEDS, cases.OUTLIERS, cases.DEAD_RECKONING, cases.LINES)
    levels = [dataclasses.astuple(case) for case in cases.PAIRS]
    for one, other in itertools.combinations(range(4), 2):
        expected = set(itertools.product(factors[one], factors[other]))
        assert {(of[one], of[other]) for of in levels} == expected


@pytest.mark.parametrize(
    "lines, overlap", [("overlap50", 0.5), ("overlap10", 0.1), ("overlap0", -0.05)]
)
def test_lines_overlap_by_what_they_are_called(lines, overlap):
    layout = cases.LINES[lines]
    mission = dataclasses.replace(
        get_mission("lolo3"),
        area_m=layout.area_m,
        line_spacing_m=layout.spacing_m,
        crossing_spacing_m=layout.crossing_m,
    )
    y_m = sorted({round(y, 6) for _, y in plan_waypoints(mission)})
    spacings_m = [b - a for a, b in zip(y_m, y_m[1:])]
    assert spacings_m == pytest.approx([(1 - overlap) * cases.SWATH_M] * len(spacings_m))


def test_contestants_set_parameters_that_exist():
    for name in contestants.CONTESTANTS:
        assert list(complaints(contestants.overlay(name), default_parameters())) == []
    assert contestants.overlay("paper")["lc"]["weights"] == "product"
    with pytest.raises(ValueError, match="contestant is 'best', expected one of paper"):
        contestants.overlay("best")
    changed = contestants.overlay("gmrf40,lc/effective_beams=8,smoothing/period_s=0.0")
    assert changed["lc"]["effective_beams"] == 8 and changed["smoothing"]["period_s"] == 0.0
    assert changed["particles"] == 40 and changed["map"]["engine"] == "gmrf"
    with pytest.raises(ValueError, match="lc/effective_beam is unknown"):
        contestants.overlay("gmrf40,lc/effective_beam=8")
    with pytest.raises(ValueError, match="is 'fast', expected group/parameter=value"):
        contestants.overlay("gmrf40,fast")


def row(**over):
    """A run's row, made up."""
    fields = dict.fromkeys(
        "dr_ate_aligned_rmse_m ate_aligned_rmse_m ideal_ate_aligned_rmse_m online_nees nees "
        "closures_refused map_rmse_m seabed_rmse_m grid_rmse_m wall_s".split(),
        1.0,
    )
    fields.update(case="base", seed=1, contestant="gmrf100", commit="x", closures_accepted=50)
    fields.update(dr_ate_rmse_m=4.0, online_ate_rmse_m=1.0, ideal_online_ate_rmse_m=0.8)
    fields.update(ate_rmse_m=0.5, ideal_ate_rmse_m=0.4, closures_wrong=1)
    fields.update(loop_closure_prompts=10, resamplings=4, founders=1)
    return {**fields, **over}


def test_tables_have_medians_and_the_worst():
    rows = [row(), row(seed=2, ate_rmse_m=6.0), row(seed=3, ate_rmse_m=0.4, closures_wrong=None)]
    shown = {}
    for table in (tables.errors(rows), tables.honesty(rows)):
        header, _, line = table.splitlines()
        shown.update(zip(*(text.strip("| ").split(" | ") for text in (header, line))))
    assert float(shown["final, m"]) == 0.5 and float(shown["final over ideal"]) == 1.25
    assert float(shown["worst final over DR"]) == 1.5
    assert float(shown["wrong, %"]) == pytest.approx(100 * 2 / 150, rel=0.01)
    assert float(shown["prompts that resample"]) == 0.4
    assert len(tables.every(rows).splitlines()) == 2 + 3


def test_targets_are_held_against_all_runs_those_of_ratios_against_the_ones_with_relief():
    rows = [row(), row(seed=2, ate_rmse_m=0.9), row(seed=3, online_nees=7.0, closures_wrong=2)]
    rows += [row(case="cheap", nees=3.0), row(case="flat", ate_rmse_m=5.0)]
    rows += [row(contestant="submaps", ate_rmse_m=0.5), row(contestant="submaps", case="flat")]
    lines = [
        line.strip("| ").split(" | ") for line in against_targets(rows, "gmrf100").splitlines()
    ]
    reached = {what: (at, value) for what, at, value in lines[2:]}
    assert reached["final over the ideal smoother, the same"] == ("1.5", "1.25")
    assert reached["final over dead reckoning, worst of all runs"] == ("1.1", "1.25")
    assert reached["wrong of 250 closures, %"] == ("1", "2.4")
    assert reached["NEES, medians of the cases"] == ("0.5 to 2", "1 (base) to 3 (cheap)")
    # of the base 1, 1 and 7
    assert reached["online NEES, means of the cases"] == ("0.5 to 2", "1 (cheap) to 3 (base)")
    assert reached["prompts that resample, median of all runs"] == ("0.5", "0.4")
    # of the seeds that both have
    assert reached["final over the best peer, worst case (flat, submaps)"] == ("1.1", "10")
    assert not any("peer" in line for line in against_targets(rows[:5], "gmrf100").splitlines())
    # 10 on the first seed and 2.5 on the next: their geometric mean
    rows += [row(case="flat", seed=2), row(contestant="submaps", case="flat", seed=2)]
    rows[-1]["ate_rmse_m"] = 0.2
    assert "final over the best peer, worst case (flat, submaps) | 1.1 | 5 |" in against_targets(
        rows, "gmrf100"
    )


def test_a_change_is_worth_what_it_does_to_the_same_surveys(tmp_path, monkeypatch, capsys):
    before = [row(seed=seed) for seed in (1, 2)] + [row(case="flat"), row(contestant="submaps")]
    after = [row(seed=1, ate_rmse_m=0.5), row(seed=2, ate_rmse_m=2.0, nees=3.0), row(seed=3)]
    after += [row(case="flat", ate_rmse_m=0.25)]
    files = [tmp_path / "before.jsonl", tmp_path / "after.jsonl"]
    for file, rows in zip(files, (before, after)):
        file.write_text("".join(json.dumps(of_file) + "\n" for of_file in rows), encoding="utf-8")
    monkeypatch.setattr("sys.argv", ["compare", *map(str, files)])
    compare.main()
    head, _, *lines = (
        line.strip("| ").split(" | ") for line in capsys.readouterr().out.splitlines()
    )
    base, flat, together = (dict(zip(head, line)) for line in lines)
    old = row()["ate_rmse_m"]
    assert (base["case"], base["seeds"]) == ("base", "2")
    assert float(base["final"]) == pytest.approx(1.0 / old, rel=1e-2)  # sqrt(0.5 * 2)
    assert float(flat["final"]) == pytest.approx(0.25 / old, rel=1e-2)
    assert (together["case"], together["seeds"]) == ("all", "3")
    dr = row()["dr_ate_rmse_m"]
    assert float(together["worst final over DR, after"]) == pytest.approx(2.0 / dr, rel=1e-2)
    assert together["NEES above 2, after"] == "1"


def test_relief_is_what_stands_out_of_the_plane():
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(0, 40, 0.25), np.arange(0, 40, 0.25)))
    slope = np.column_stack([x, y, 0.3 * x - 0.1 * y])
    # its own slope within a cell is not relief: cells have their middle's depth
    assert relief.relief_m(slope) == pytest.approx((0.0, 0.0), abs=1e-9)
    waves = slope + np.column_stack([0 * x, 0 * y, 0.5 * np.sin(x)])
    range_m, std_m = relief.relief_m(waves)
    # a sine's, less what is lost by means over 1 m
    assert 0.9 < range_m <= 1.0 and std_m == pytest.approx(0.5 / np.sqrt(2), rel=0.06)


def test_figures_show_every_seed_and_the_medians():
    rows = [row(), row(seed=2, ate_rmse_m=6.0), row(seed=3, ate_rmse_m=0.4, online_nees=None)]
    rows.append(row(contestant="grid", ate_rmse_m=2.0))
    final = figures.of_case("base", rows).axes[1]
    assert final.get_title(loc="left") == "final ATE"
    dots = {line.get_ydata()[0]: sorted(line.get_xdata()) for line in final.lines[::2]}
    # from the top: dead reckoning, the contestants as they came, the ideal
    assert dots == {3: [4.0] * 3, 2: [0.4, 0.5, 6.0], 1: [2.0], 0: [0.4] * 3}
    medians = [line.get_xdata()[0] for line in final.lines[1::2]]
    assert medians == [4.0, 0.5, 2.0, 0.4]

    rows.append(row(case="flat", ate_rmse_m=3.0, ideal_ate_rmse_m=None))
    panels = figures.overview(rows, "gmrf100").axes
    shown = [sorted(line.get_xdata()) for line in panels[1].lines if len(line.get_xdata()) == 3]
    assert shown == [pytest.approx([1.0, 1.25, 15.0])]
    assert [text.get_text() for text in panels[0].get_yticklabels()] == ["flat", "base"]


def test_a_study_goes_on_where_it_was(tmp_path, monkeypatch):
    ran = []

    def replay(contestant, seed, bag, folder):
        ran.append((contestant, seed))
        keys = ("case", "seed", "contestant")
        return {name: value for name, value in row().items() if name not in keys}

    monkeypatch.setattr(command, "make_survey", lambda case, seed, out: out / "a.bag")
    monkeypatch.setattr(command, "replay", replay)
    survey = (cases.BASE, 201)
    command.Study(tmp_path, ["gmrf40"]).run(*survey)
    study = command.Study(tmp_path, ["gmrf40", "gmrf100"])
    study.run(*survey)
    assert ran == [("gmrf40", 201), ("gmrf100", 201)]
    assert [row["contestant"] for row in study.rows([survey])] == ["gmrf40", "gmrf100"]


def test_a_run_that_fails_is_told_and_run_again_the_next_time(tmp_path, monkeypatch):
    monkeypatch.setattr(command, "make_survey", lambda case, seed, out: out / "a.bag")
    broken = ["bash", "-c", "echo no room; exit 3"]
    monkeypatch.setattr(command, "replay", lambda *_: replays._row(broken, tmp_path))
    study = command.Study(tmp_path, ["gmrf40", "gmrf100"])
    failure = study.run(cases.BASE, 201)
    assert "returned non-zero exit status 3" in failure and f"{tmp_path}/launch.log" in failure
    assert (tmp_path / "launch.log").read_text() == "no room\n"
    assert study.rows([(cases.BASE, 201)]) == []


def test_figure_8_has_both_runs_and_both_ideals(run, tmp_path, monkeypatch):
    paper = dataclasses.replace(run, estimate=run.dead_reckoning)
    for name, one in (("paper", paper), ("ours", run)):
        (tmp_path / name).mkdir()
        save_run(one, tmp_path / name)
    drawn = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, path: drawn.append((figure, path)))
    monkeypatch.setattr(
        "sys.argv", ["figure8", *(str(tmp_path / n) for n in ("paper", "ours", "f"))]
    )
    figure8.main()
    [(figure, path)] = drawn
    assert path == tmp_path / "f"
    errors_m = {
        line.get_label().rsplit(" (", 1)[0]: float(np.sqrt(np.nanmean(line.get_ydata() ** 2)))
        for line in figure.axes[1].lines
    }
    assert set(errors_m) == set(figure8.LOOK)
    assert errors_m["the paper's rule"] == pytest.approx(errors_m["dead reckoning"])
    assert errors_m["ideal smoother"] < errors_m["ours"] < errors_m["ours, online"]
