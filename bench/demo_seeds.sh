#!/usr/bin/env bash
# Runs the demo for several seeds and prints a table of README.md.
#   bench/demo_seeds.sh [--engine svgp|gmrf] [DIR] [SEED ...]
#                       by default svgp, out/demo_seeds and 1 2 3 4 5 6
set -euo pipefail
cd "$(dirname "$0")/.."
engine=svgp
if [ "${1:-}" = --engine ]; then
  engine=$2
  shift 2
fi
out=${1:-out/demo_seeds}
shift || true
[ $# -gt 0 ] || set -- 1 2 3 4 5 6
for seed in "$@"; do
  tools/demo.sh --engine "$engine" --seed "$seed" "$out/seed_$seed"
done
/usr/bin/python3 - "$out" "$@" <<'PYTHON'
import json
import sys
from pathlib import Path

columns = {
    "DR ATE (m)": "dr_ate_rmse_m",
    "online ATE (m)": "online_ate_rmse_m",
    "its ideal": "ideal_online_ate_rmse_m",
    "final ATE (m)": "ate_rmse_m",
    "its ideal ": "ideal_ate_rmse_m",
    "DR at the end (m)": "dr_final_error_m",
    "RBPF at the end (m)": "final_error_m",
    "map RMSE (m)": "map_rmse_m",
    "1 m grid RMSE (m)": "grid_rmse_m",
}
print("| seed |", " | ".join(columns), "|")
print("|---" * (len(columns) + 1) + "|")
for seed in sys.argv[2:]:
    report = json.loads((Path(sys.argv[1]) / f"seed_{seed}" / "report.json").read_text())
    print(f"| {seed} |", " | ".join(f"{report[name]:.2f}" for name in columns.values()), "|")
PYTHON
