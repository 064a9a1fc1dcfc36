#!/usr/bin/env bash
# Runs the benchmarks, prints a table, and writes DIR/bench.json and figures.
#   tools/bench.sh [DIR] [--only SECTION ...]     DIR: out/bench by default
# The first run fetches about 3 GB from PyPI: GPyTorch, to race against.
set -euo pipefail
cd "$(dirname "$0")/.."
tools/setup.sh --bench
. tools/env.sh
exec python3 -m bench "$@"
