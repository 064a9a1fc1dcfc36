#!/usr/bin/env bash
# What the data allow: the method and its rivals on many simulated surveys, beside the ideal.
#   tools/study.sh [DIR] [--cases CASE ...] [--contestants NAME ...] [--seeds K] [--jobs N]   --help says more
set -euo pipefail
cd "$(dirname "$0")/.."
tools/setup.sh
. tools/env.sh
exec python3 -m bench.study "$@"
