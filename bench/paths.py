"""Where things are in the source tree."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
#: Virtual environments with GPyTorch, made by tools/setup.sh --bench.
ENVIRONMENTS = ROOT / "build" / "bench"
