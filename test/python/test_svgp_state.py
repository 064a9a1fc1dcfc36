"""Maps as bytes, settings and the group."""

import io
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from rbpf_svgp_slam.maps import MinibatchMap, group_class, load_map, make_group
from rbpf_svgp_slam.parameters.known import config_folder
from rbpf_svgp_slam.svgp import state
from rbpf_svgp_slam.svgp.config import SvgpConfig
from rbpf_svgp_slam.svgp.group import svgp_class
from rbpf_svgp_slam.svgp.minibatch_svgp import MinibatchSvgp
from rbpf_svgp_slam.svgp.optimizers import OPTIMIZERS

AREA = [[-50.0, -30.0], [50.0, -30.0], [50.0, 30.0], [-50.0, 30.0]]
CONFIG = SvgpConfig(
    inducing_points=40,
    minibatch_size=60,
    optimizer="adam",
    convergence_window=4,
    convergence_decay=0.5,
)


def train(engine, steps, seed=0):
    rng = np.random.default_rng(seed)
    for _ in range(steps):
        beams = rng.uniform([-50.0, -30.0, -12.0], [50.0, 30.0, -10.0], (60, 3))
        if isinstance(engine, MinibatchMap):
            engine.train_step(beams.astype(np.float32), 5000)
        else:
            engine.take_in(beams.astype(np.float32))
    return engine


def make(config):
    """A map that stands alone."""
    return svgp_class(config)(config, AREA)


def trained(config=CONFIG):
    engine = train(make(config), 7)
    engine.skipped_steps, engine.jitter_raises = 2, 3
    return engine


BYTES = trained().to_bytes()


def rewritten(**changes):
    """A state with some entries replaced; None takes one out."""
    with np.load(io.BytesIO(BYTES)) as archive:
        entries = {**{name: archive[name] for name in archive.files}, **changes}
    buffer = io.BytesIO()
    np.savez(buffer, **{name: value for name, value in entries.items() if value is not None})
    return buffer.getvalue()


@pytest.mark.parametrize("steps", [0, 1, 7])
@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("optimizer", sorted(OPTIMIZERS))
def test_training_goes_on_bit_for_bit(steps, dtype, optimizer):
    config = replace(CONFIG, dtype=dtype, optimizer=optimizer)
    original = train(make(config), steps)
    copy = svgp_class(config).from_bytes(original.to_bytes(), original.config)
    assert copy.to_bytes() == original.to_bytes()
    train(original, 5, seed=3)
    train(copy, 5, seed=3)
    assert copy.to_bytes() == original.to_bytes()
    assert torch.equal(copy.optimizer.model.flat, original.optimizer.model.flat)
    for ours, theirs in zip(copy.predict(np.eye(2)), original.predict(np.eye(2))):
        np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("optimizer", sorted(OPTIMIZERS))
def test_a_copy_goes_on_as_the_original_does_and_neither_disturbs_the_other(optimizer, dtype):
    original = train(make(replace(CONFIG, dtype=dtype, optimizer=optimizer)), 5)
    before, prediction = original.to_bytes(), original.predict(np.eye(2))
    copy = original.copy()
    train(original, 5, seed=3)
    assert copy.to_bytes() == before
    np.testing.assert_array_equal(copy.predict(np.eye(2)), prediction)
    after, prediction = original.to_bytes(), original.predict(np.eye(2))
    train(copy, 5, seed=3)
    assert copy.to_bytes() == after
    np.testing.assert_array_equal(copy.predict(np.eye(2)), prediction)
    train(copy, 1)
    assert original.to_bytes() == after
    np.testing.assert_array_equal(original.predict(np.eye(2)), prediction)


def test_everything_is_restored():
    original, copy = trained(), MinibatchSvgp.from_bytes(BYTES, CONFIG)
    for name in ("iterations", "skipped_steps", "ready", "objective", "noise_variance_m2"):
        assert getattr(copy, name) == getattr(original, name)
    assert copy.iterations == 7
    assert (copy.skipped_steps, copy.jitter_raises) == (2, 3)
    assert len(copy._convergence.averages) == 4  # steps 4 to 7: 1 − 0.5⁴ > 0.9


def test_a_copy_is_independent():
    original = trained()
    copy = MinibatchSvgp.from_bytes(original.to_bytes(), CONFIG)
    train(copy, 3)
    assert original.to_bytes() == BYTES


def test_loads_with_the_settings_it_was_trained_with():
    engine = load_map("svgp", BYTES)
    assert engine.config == CONFIG
    assert engine.to_bytes() == BYTES


def test_what_does_not_change_the_model_may_change():
    config = replace(CONFIG, learning_rate=0.01, convergence_window=2, minibatch_size=7)
    engine = MinibatchSvgp.from_bytes(BYTES, config)
    assert engine.config == config
    assert engine.objective == trained().objective


@pytest.mark.parametrize(
    "name, value",
    [("kernel", "matern32"), ("inducing_points", 41), ("jitter", 1e-5), ("dtype", "float64")],
)
def test_a_map_of_another_model_is_refused(name, value):
    config = replace(CONFIG, **{name: value})
    written = getattr(CONFIG, name)
    with pytest.raises(
        ValueError, match=f"written with svgp/{name} {written!r}; expected {value!r}"
    ):
        MinibatchSvgp.from_bytes(BYTES, config)


@given(length=st.integers(0, len(BYTES) - 1))
@settings(max_examples=60, deadline=None)
def test_truncated_bytes_are_refused(length):
    with pytest.raises(ValueError, match=f"map of {length} bytes is truncated"):
        MinibatchSvgp.from_bytes(BYTES[:length], CONFIG)


@given(position=st.integers(0, len(BYTES) - 1), bit=st.integers(0, 7))
@settings(max_examples=300, deadline=None)
def test_damaged_bytes_are_refused_or_harmless(position, bit):
    damaged = bytearray(BYTES)
    damaged[position] ^= 1 << bit
    try:
        engine = MinibatchSvgp.from_bytes(bytes(damaged), CONFIG)
    except ValueError:
        return
    # A zip file holds fields, such as dates, that nothing depends on.
    assert engine.to_bytes() == BYTES


def test_foreign_bytes_are_refused():
    buffer = io.BytesIO()
    np.savez(buffer, z=np.zeros(3))
    with pytest.raises(ValueError, match="map's format is missing; expected rbpf_svgp_slam/svgp"):
        MinibatchSvgp.from_bytes(buffer.getvalue(), CONFIG)
    with pytest.raises(ValueError, match="format is other/engine; expected rbpf_svgp_slam/svgp"):
        MinibatchSvgp.from_bytes(rewritten(format="other/engine"), CONFIG)
    for foreign in (b"", b"{}", b"\x93NUMPY" + bytes(100)):
        with pytest.raises(ValueError, match="truncated or no npz file"):
            MinibatchSvgp.from_bytes(foreign, CONFIG)


def test_a_pickle_is_refused():
    with pytest.raises(ValueError, match="[pP]ickle"):
        MinibatchSvgp.from_bytes(rewritten(config=np.array({"a": 1}, dtype=object)), CONFIG)


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"version": 1}, "version is 1; expected 2"),
        ({"adam_first": None}, "no entry adam_first"),
        ({"iterations": 1.5}, r"iterations is float64\[\]"),
        ({"parameters": np.zeros(3, np.float32)}, "parameters has 3 numbers; expected 944 finite"),
        ({"parameters": np.full(944, np.nan, np.float32)}, "parameters has 944 numbers"),
        ({"config": "{"}, "config is not that of an SVGP"),
        ({"config": '{"kernal": 1}'}, "config is not that of an SVGP"),
        ({"config": "[]"}, "config is not that of an SVGP"),
    ],
)
def test_malformed_entries_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        MinibatchSvgp.from_bytes(rewritten(**changes), CONFIG)


@pytest.mark.parametrize("optimizer", sorted(OPTIMIZERS))
def test_documented_entries_are_those_written(optimizer):
    engine = trained(replace(CONFIG, optimizer=optimizer))
    with np.load(io.BytesIO(engine.to_bytes())) as archive:
        own = OPTIMIZERS[optimizer].ENTRIES
        assert set(archive.files) == {"format", "version", *state.ENTRIES, *own}
    for name in state.ENTRIES:
        assert name in state.__doc__
    for name in own:
        assert f"`{name}`" in OPTIMIZERS[optimizer].__doc__


def test_a_map_of_another_optimizer_lacks_what_this_one_needs():
    with pytest.raises(ValueError, match="written with svgp/optimizer 'adam'; expected 'natgrad'"):
        MinibatchSvgp.from_bytes(BYTES, replace(CONFIG, optimizer="natgrad"))


# Settings and group


def test_the_papers_overlay_is_the_papers():
    paper = yaml.safe_load((config_folder() / "paper.yaml").read_text())
    config = SvgpConfig.from_parameters(paper["svgp"])
    assert (config.inducing_points, config.minibatch_size) == (400, 1000)
    assert (config.kernel, config.optimizer, config.learning_rate) == ("matern12", "adam", 0.1)


@pytest.mark.parametrize(
    "name, value, expected",
    [
        ("inducing_points", 0, "a whole number from 1 to"),
        ("inducing_points", 10.0, "a value of type int"),
        ("inducing_points", True, "a value of type int"),
        ("kernel", "rbf", "one of matern12, matern32, matern52"),
        ("optimizer", "lbfgs", "one of adam, natgrad, streaming"),
        ("inducing_points", 5001, "a whole number from 1 to 5000"),
        ("outputscale_m2", 1e10, "up to 1e+09"),
        ("natgrad_rate", 1.5, "a number above 0, up to 1"),
        ("shared_hyperparameters", True, "false with optimizer adam"),
        ("natgrad_model_period", 0, "a whole number from 1 to"),
        ("learning_rate", 0.0, "a number above 0"),
        ("learning_rate", "fast", "a value of type float"),
        ("learning_rate", float("nan"), "a finite number"),
        ("lengthscale_m", -1.0, "0 or a number above 1e-06"),
        ("noise_std_m", 0.01, "a number above 0.01"),
        ("jitter", 1.0, "a number between 0 and 1"),
        ("learn_inducing_points", 1, "a value of type bool"),
        ("convergence_decay", 1.0, "a number between 0 and 1"),
        ("device", "tpu", "one of cpu, cuda"),
    ],
)
def test_settings_are_validated(name, value, expected):
    with pytest.raises(ValueError) as error:
        SvgpConfig(**{"optimizer": "adam", name: value})
    assert str(error.value).startswith(f"svgp/{name} is {value!r}; expected ")
    assert expected in str(error.value)


def test_settings_from_a_parameter_group():
    tree = {"inducing_points": 9, "learning_rate": 1, "convergence": {"window": 7}}
    config = SvgpConfig.from_parameters(tree)
    assert config == SvgpConfig(inducing_points=9, learning_rate=1.0, convergence_window=7)
    with pytest.raises(ValueError, match="svgp/convergence_windw is unknown; expected one of"):
        SvgpConfig.from_parameters({"convergence": {"windw": 7}})


def parameters(engine="svgp"):
    """What a node passes on: the survey area in the map frame."""
    area = tuple((x + 1000.0, y - 7000.0) for x, y in AREA)
    group = {"inducing_points": 40, "minibatch_size": 60, "optimizer": "adam"}
    group["convergence"] = {"window": 4, "decay": 0.5}
    return SimpleNamespace(map=SimpleNamespace(engine=engine), survey_area=area, engine_group=group)


def test_a_group_makes_equal_maps_about_the_survey_origin():
    group = make_group(parameters())
    first, second = group.create(), group.create()
    assert group.minibatch_size == 60
    assert first.to_bytes() == second.to_bytes() == MinibatchSvgp(CONFIG, AREA).to_bytes()
    assert np.abs(first.support_points()[:, :2]).max(axis=0).tolist() < [50.0, 30.0]
    assert group.load(BYTES).to_bytes() == BYTES


def test_unknown_engine_is_refused():
    with pytest.raises(ValueError, match="map/engine is 'grid'; expected one of svgp"):
        group_class("grid")
    with pytest.raises(ValueError, match="map/engine is 'grid'"):
        make_group(parameters(engine="grid"))
