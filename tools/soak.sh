#!/usr/bin/env bash
# A live survey at four times its speed, whose processes are killed, stopped and sent rubbish, by a seed.
#   tools/soak.sh [MINUTES] [--seed N] [--spare NAME ...] [--folder DIR]    120 minutes of survey by default; --help says more
set -euo pipefail
cd "$(dirname "$0")/.."
tools/setup.sh
. tools/env.sh
exec python3 test/ros/soak.py "$@"
