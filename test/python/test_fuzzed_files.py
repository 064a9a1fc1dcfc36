"""Whatever the bytes of a map or of a run folder's file are, they are read or refused.

RBPF_FUZZ_S seconds of each, in place of its own share: tools/fuzz.sh.
"""

import io
import os
import resource
import time

import numpy as np
import pytest

from rbpf_svgp_slam.gmrf.gmrf_config import GmrfConfig
from rbpf_svgp_slam.gmrf.gmrf_group import GmrfGroup
from rbpf_svgp_slam.maps import load_map
from rbpf_svgp_slam.run.run_files import RunFolderError, load_npz
from rbpf_svgp_slam.svgp import state
from rbpf_svgp_slam.svgp.config import SvgpConfig
from rbpf_svgp_slam.svgp.minibatch_svgp import MinibatchSvgp

AREA = [[-15.0, -15.0], [15.0, -15.0], [15.0, 15.0], [-15.0, 15.0]]
TELLING = (
    b"\0",
    b"\xff",
    b"\xff\xff\xff\xff",
    b"\xff\xff\xff\x7f",
    b"\0\0\x80\x7f",
    b"\0\0\xc0\x7f",
)


def peak_mb():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6


def seeds(count):
    """So many, or those of RBPF_FUZZ_S seconds."""
    end_s = time.monotonic() + float(os.environ.get("RBPF_FUZZ_S", 0.0))
    seed = 0
    while seed < count or time.monotonic() < end_s:
        yield seed
        seed += 1
    print(f"{seed} damaged ones tried, at most {peak_mb():.0f} MB")


def mutated(data, rng):
    """One to four bits, bytes, numbers or pieces of it are other ones, missing or there twice."""
    data = bytearray(data)
    for _ in range(rng.integers(1, 5)):
        if not data:
            break
        at, size = int(rng.integers(len(data))), int(rng.integers(1, 64))
        kind = rng.integers(6)
        if kind == 0:
            data[at] ^= 1 << int(rng.integers(8))
        elif kind == 1:
            data[at] = int(rng.integers(256))
        elif kind == 2:
            telling = TELLING[rng.integers(len(TELLING))]
            data[at : at + len(telling)] = telling
        elif kind == 3:
            del data[at:]
        elif kind == 4:
            del data[at : at + size]
        else:
            data[at:at] = data[at : at + size]
    return bytes(data)


def beams(n=400):
    rng = np.random.default_rng(0)
    xy = rng.uniform(-15.0, 15.0, (n, 2))
    return np.column_stack([xy, np.sin(xy[:, 0] / 4.0) - 30.0]).astype(np.float32)


def svgp_bytes():
    engine = MinibatchSvgp(SvgpConfig(inducing_points=9, optimizer="natgrad"), AREA)
    for _ in range(3):
        engine.train_step(beams(), 400)
    return engine.to_bytes()


def gmrf_bytes():
    group = GmrfGroup(GmrfConfig(spacing_m=1.5, lengthscale_m=12.0, outputscale_m2=0.5))
    group.study(beams(40).astype(float))
    return group.create().to_bytes()


def read_or_refused(engine, data):
    """Whether it is a map, which then predicts; whatever else is raised fails the test."""
    try:
        loaded = load_map(engine, data)
    except ValueError:
        return False
    try:
        mean, variance = loaded.predict(np.zeros((2, 2), np.float32))
    except ArithmeticError:  # numbers of no Gaussian: a prompt fails by it
        return False
    assert mean.shape == variance.shape == (2,)
    return True


@pytest.mark.parametrize("engine, make", [("svgp", svgp_bytes), ("gmrf", gmrf_bytes)])
def test_a_damaged_map_is_read_or_refused(engine, make):
    whole = make()
    assert read_or_refused(engine, whole)
    read = [
        read_or_refused(engine, mutated(whole, np.random.default_rng(seed))) for seed in seeds(600)
    ]
    assert not all(read)


def test_a_map_whose_entries_are_forged_is_read_or_refused():
    """Their checksums agree."""
    whole = state.decode(svgp_bytes())
    names = sorted(whole)
    refused = 0
    for seed in seeds(400):
        rng = np.random.default_rng(seed)
        entries = dict(whole)
        name = names[rng.integers(len(names))]
        forged = [
            lambda a: np.full_like(a, np.nan) if a.dtype.kind == "f" else a[..., None],
            lambda a: np.full_like(a, np.inf) if a.dtype.kind == "f" else a,
            lambda a: -a if a.dtype.kind in "if" else a.astype("U9"),
            lambda a: a.ravel()[:-1],
            lambda a: np.zeros((0,) + a.shape, a.dtype),
            lambda a: a.astype(np.float16) if a.dtype.kind in "if" else np.array(7),
            lambda a: None,
        ][rng.integers(7)](entries[name])
        entries[name] = forged
        if forged is None:
            del entries[name]
        buffer = io.BytesIO()
        np.savez(buffer, **entries)
        refused += not read_or_refused("svgp", buffer.getvalue())
    assert refused > 100


def test_a_damaged_file_of_a_run_is_read_or_refused_by_its_name(tmp_path):
    path = tmp_path / "survey.npz"
    np.savez_compressed(path, stamp_s=np.arange(50.0), levelled=np.ones((60, 3), np.float32))
    whole = path.read_bytes()
    refused = 0
    for seed in seeds(400):
        path.write_bytes(mutated(whole, np.random.default_rng(seed)))
        try:
            load_npz(path, ("stamp_s", "levelled"))
        except RunFolderError as error:
            assert str(path) in str(error)
            refused += 1
    assert refused > 100
