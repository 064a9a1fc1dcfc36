"""config/default.yaml, the one source of defaults and names; the overlays that are shipped."""

import subprocess
import sys
from dataclasses import MISSING, fields
from itertools import chain

import pytest
import yaml

from rbpf_svgp_slam.experiments import experiment_command
from rbpf_svgp_slam.experiments.plan import Options
from rbpf_svgp_slam.maps import ENGINES, make_group
from rbpf_svgp_slam.nested import all_names, flatten, merged
from rbpf_svgp_slam.parameters import loading
from rbpf_svgp_slam.parameters.known import (
    complaints,
    config_folder,
    default_parameters,
    nearest_name,
)
from rbpf_svgp_slam.parameters.loading import (
    ParameterError,
    RecorderParameters,
    validate,
    validate_recorder,
)
from rbpf_svgp_slam.simulation import simulate_command
from rbpf_svgp_slam.svgp.config import RULES, SvgpConfig

SQUARE = [[0.0, 0.0], [40.0, 0.0], [40.0, 40.0], [0.0, 40.0]]
GROUPS = (
    loading.NodeParameters,
    loading.FrameParameters,
    loading.MapParameters,
    loading.OutputParameters,
    loading.RecorderParameters,
)


@pytest.fixture
def tree():
    return {**default_parameters(), "survey_area": SQUARE}


# Defaults


def test_every_default_of_the_svgp_maps_is_the_shipped_one():
    shipped = {
        name.replace("/", "_"): value for name, value in flatten(default_parameters()["svgp"])
    }
    ours = {field.name: field.default for field in fields(SvgpConfig)}
    assert sorted(ours) == sorted(shipped) == sorted(RULES)
    differing = {
        f"svgp/{name}": f"{ours[name]!r}, config/default.yaml has {shipped[name]!r}"
        for name in ours
        if (ours[name], type(ours[name])) != (shipped[name], type(shipped[name]))
    }
    assert not differing


def test_what_is_loaded_has_no_defaults_of_its_own():
    for field in chain.from_iterable(map(fields, GROUPS)):
        assert field.default is MISSING and field.default_factory is MISSING, field.name


def test_every_experiment_starts_from_the_shipped_parameters(tmp_path):
    shipped, options = default_parameters(), Options()
    arguments = experiment_command._parse(["exp1", "--out", str(tmp_path)])
    assert options.optimizer == arguments.optimizer == shipped["svgp"]["optimizer"]
    assert options.seed == arguments.seed == shipped["seed"]


def test_every_parameter_read_here_is_a_shipped_one():
    names = set(all_names(default_parameters()))
    assert set(loading.RULES) <= names


# Overlays


@pytest.mark.parametrize("overlay", ["default", "demo", "gmrf", "mapping", "paper", "empty"])
def test_every_shipped_overlay_is_accepted(tree, overlay):
    differing = yaml.safe_load((config_folder() / f"{overlay}.yaml").read_text())
    parameters = validate({**merged(tree, differing), "survey_area": SQUARE})
    # the engine's group too
    wanted = parameters.engine_group.get("minibatch_size", 0)
    assert make_group(parameters).minibatch_size == wanted


def test_no_shipped_overlay_is_left_out():
    shipped = {path.stem for path in config_folder().glob("*.yaml")}
    assert shipped == {"default", "demo", "gmrf", "mapping", "paper", "empty"}


def test_the_simulators_overlay_is_accepted(tree, tmp_path):
    bag = tmp_path / "survey.bag"
    simulation = ["--mission", "demo", "--scale", "0.05", "--duration", "10", "--out", str(bag)]
    assert simulate_command.main([*simulation, "--origin", "57.5", "11.2"]) == 0
    overlay = yaml.safe_load(bag.with_suffix(".survey.yaml").read_text())
    parameters = validate(merged(tree, overlay))
    assert parameters.survey_area == tuple(map(tuple, overlay["survey_area"]))
    assert parameters.survey_origin == (57.5, 11.2)
    assert not list(complaints(overlay, default_parameters()))


# Names


@pytest.mark.parametrize(
    "mistyped, meant",
    [
        ("map/resolutoin_m", "map/resolution_m"),
        ("particels", "particles"),
        ("svgp/natgrad_rate", "svgp/natgrad/rate"),  # as the settings' own field is called
        ("svgp/natgard", "svgp/natgrad"),
        ("svgp/streaming/tolerence", "svgp/streaming/tolerance"),
        ("lc/rate", "lc/rate_hz"),
        ("resamplng", "resampling"),
        ("svgp/threads", "map/threads"),
        ("lc/hold_back_s", "mapping/hold_back_s"),
        ("rate_hz", "lc/rate_hz"),
        ("map/tiles", ""),
        ("gravity", ""),
    ],
)
def test_the_nearest_name_is_what_was_meant(mistyped, meant):
    assert nearest_name(mistyped, list(all_names(default_parameters()))) == meant


@pytest.mark.parametrize(
    "group, name, message",
    [
        ("map", "resolutoin_m", "map/resolutoin_m is unknown; did you mean map/resolution_m?"),
        ("svgp", "kernal", "svgp/kernal is unknown; did you mean svgp/kernel?"),
        # groups whose values the core checks
        ("lc", "efective_beams", "lc/efective_beams is unknown; did you mean lc/effective_beams?"),
        ("motion", "gravity", "motion/gravity is unknown; expected one of surge_std_m, sway_std_m"),
    ],
)
def test_a_misspelt_name_is_answered_with_the_right_one(tree, group, name, message):
    tree[group][name] = 1.0
    with pytest.raises(ParameterError) as error:
        validate(tree)
    assert str(error.value).startswith(f"rbpf_svgp_slam/{message}")


def test_experiment_py_answers_in_the_same_words(tmp_path, capsys):
    path = tmp_path / "mine.yaml"
    path.write_text("map: {resolutoin_m: 2.0}\n")
    out = tmp_path / "out"
    assert experiment_command.main(["exp1", "--config", str(path), "--out", str(out)]) == 2
    message = "mine.yaml: map/resolutoin_m is unknown; did you mean map/resolution_m?"
    assert message in capsys.readouterr().err


def test_an_engine_from_elsewhere_brings_its_own_group(tree, monkeypatch):
    monkeypatch.setitem(ENGINES, "grid", ("somewhere.else", "GridMap"))
    tree["map"]["engine"] = "grid"
    with pytest.raises(ParameterError, match="rbpf_svgp_slam/grid is not set; expected a group"):
        validate(tree)
    tree["grid"] = {"spacing_m": 2.0}
    assert validate(tree).engine_group == {"spacing_m": 2.0}
    tree["map"]["engine"] = "svgp"
    with pytest.raises(ParameterError, match="rbpf_svgp_slam/grid is unknown"):
        validate(tree)


# The recorder


def test_the_recorders_parameters_are_read_through_the_same_loader(tree):
    parameters = validate(tree)
    output = parameters.output
    assert vars(output).items() <= tree["output"].items()
    tree["output"]["publish_rate_hz"] = 0
    with pytest.raises(ParameterError, match="publish_rate_hz is 0; expected a number from 0.01"):
        validate(tree)


def test_the_recorders_private_parameters(tmp_path):
    launched = {
        "out": str(tmp_path),
        "bag": "F.bag",
        "offline": True,
        "terrain": "F.npz",
        "resume": True,
    }
    assert validate_recorder(launched) == RecorderParameters(
        tmp_path, "F.bag", True, "F.npz", False, True
    )
    assert validate_recorder({"out": str(tmp_path)}) == RecorderParameters(
        tmp_path, "", False, "", False, False
    )
    assert validate_recorder({"out": "~/run"}).out_dir.is_absolute()


@pytest.mark.parametrize(
    "private, message",
    [
        ({}, "~out is not set; expected the absolute path of the run folder"),
        ({"out": "run"}, "~out is 'run'; expected the absolute path of the run folder"),
        ({"out": ""}, "~out is ''; expected the absolute path of the run folder"),
        ({"out": "/DIR", "bag": 3}, "~bag is 3; expected a value of type str"),
        ({"out": "/DIR", "offline": "yes"}, "~offline is 'yes'; expected a value of type bool"),
        ({"out": "/DIR", "terrain": None}, "~terrain is None; expected a value of type str"),
    ],
)
def test_bad_private_parameters_are_refused(private, message):
    with pytest.raises(ParameterError, match=message):
        validate_recorder(private)


# Rooms


def test_parameters_are_loaded_before_any_numerical_library():
    """How many threads such a library starts is a parameter."""
    script = (
        "import sys, rbpf_svgp_slam.map_node.start, rbpf_svgp_slam.parameters.loading as loading\n"
        "from rbpf_svgp_slam.parameters.known import default_parameters\n"
        f"loading.validate({{**default_parameters(), 'survey_area': {SQUARE}}})\n"
        "print(*{'numpy', 'scipy', 'torch', 'rospy'}.intersection(sys.modules))"
    )
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert not done.stdout.strip()
