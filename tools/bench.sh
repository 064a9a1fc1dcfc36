#!/usr/bin/env bash
# Runs the benchmarks, prints a table, and writes DIR/bench.json and figures.
#   tools/bench.sh [DIR] [--only SECTION ...]     DIR: out/bench by default
# The first run installs GPyTorch, to race against, from PyPI: 6 GB in build/bench.
set -euo pipefail
cd "$(dirname "$0")/.."
tools/setup.sh --bench
. tools/env.sh
exec python3 -m bench "$@"
