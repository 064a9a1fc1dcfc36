#!/usr/bin/env bash
# Maps three real files of echosounders, prints the table of docs/real_files.md, and draws its charts.
#   tools/real_files.sh [DATA [DIR]]   DATA: the folder of the files, by default ../shared/data
#                                      DIR: for run folders and pictures, by default out/real_files
set -euo pipefail
cd "$(dirname "$0")/.."
tools/setup.sh
. tools/env.sh
exec python3 -m bench.real_files "$@"
