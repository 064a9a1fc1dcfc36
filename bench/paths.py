"""Where things are in the source tree."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
#: Virtual environments with GPyTorch, made by tools/setup.sh --bench.
ENVIRONMENTS = ROOT / "build" / "bench"
#: The benchmarks written in C++, bench/core/*.cpp.
BINARIES = ROOT / "build" / "devel" / "lib" / "rbpf_svgp_slam"
