"""What the numerical libraries read from the environment, once, when they are loaded."""

from __future__ import annotations

import os
from pathlib import Path

#: What OpenBLAS' kernels for SkylakeX use.
AVX512 = {"avx512f", "avx512cd", "avx512bw", "avx512dq", "avx512vl"}


def prepare(threads: int, cpuinfo: Path = Path("/proc/cpuinfo")) -> None:
    """Set the number of threads and the matrix kernels; to be called before torch is imported.

    OpenBLAS 0.3.21, Debian 12's, does not know AMD's processors with AVX-512 and takes kernels of
    half the speed for them (bench/svgp: the step). What the user has set is left alone.
    """
    os.environ["OMP_NUM_THREADS"] = str(threads)
    if _is_amd_with_avx512(cpuinfo):
        os.environ.setdefault("OPENBLAS_CORETYPE", "SkylakeX")


def _is_amd_with_avx512(cpuinfo: Path) -> bool:
    try:
        text = cpuinfo.read_text(encoding="ascii", errors="replace")
    except OSError:  # not Linux
        return False
    fields = dict(line.split(":", 1) for line in text.splitlines() if ":" in line)
    fields = {name.strip(): value.split() for name, value in fields.items()}
    return fields.get("vendor_id") == ["AuthenticAMD"] and AVX512.issubset(fields.get("flags", []))
