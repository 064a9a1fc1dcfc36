#!/usr/bin/env bash
# Runs bags as other people have them through the filter and prints a table of what came of each.
#   tools/inputs.sh [--only NAME ...] [--live] [--write] [--jobs N] [--folder DIR]
# --live: each through the live nodes too; --write: put the table into docs/inputs.md; --folder: keep
# bags, logs and run folders. All cases take some 20 minutes on two cores, live another 30.
set -euo pipefail
cd "$(dirname "$0")/.."
tools/setup.sh
. tools/env.sh
exec python3 test/ros/input_table.py "$@"
