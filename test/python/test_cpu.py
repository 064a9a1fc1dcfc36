"""The numerical libraries' environment."""

import os

import pytest

from rbpf_svgp_slam import cpu

FLAGS = "fpu sse avx2 avx512f avx512cd avx512bw avx512dq avx512vl"


@pytest.mark.parametrize(
    "vendor, flags, given, expected",
    [
        ("AuthenticAMD", FLAGS, None, "SkylakeX"),
        ("AuthenticAMD", FLAGS, "Zen", "Zen"),
        ("AuthenticAMD", "fpu sse avx2", None, None),
        ("GenuineIntel", FLAGS, None, None),
    ],
)
def test_matrix_kernels(vendor, flags, given, expected, tmp_path, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    monkeypatch.delenv("OPENBLAS_CORETYPE", raising=False)
    if given:
        monkeypatch.setenv("OPENBLAS_CORETYPE", given)
    cpuinfo = tmp_path / "cpuinfo"
    core = f"processor\t: 0\nvendor_id\t: {vendor}\nflags\t\t: {flags}\n"
    cpuinfo.write_text(f"{core}\npower management:\n\n{core}")
    cpu.prepare(2, cpuinfo)
    assert os.environ["OMP_NUM_THREADS"] == "2"
    assert os.environ.get("OPENBLAS_CORETYPE") == expected
    monkeypatch.delenv("OPENBLAS_CORETYPE", raising=False)


def test_a_machine_without_cpuinfo(tmp_path, monkeypatch):
    monkeypatch.delenv("OPENBLAS_CORETYPE", raising=False)
    cpu.prepare(1, tmp_path / "missing")
    assert "OPENBLAS_CORETYPE" not in os.environ
