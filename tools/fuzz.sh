#!/usr/bin/env bash
# Fuzzes what reads bytes for longer than the tests do: the journal's reader, the messages'
# conversions, maps and run files.
#   tools/fuzz.sh [SECONDS]    of each, 60 by default
set -euo pipefail
cd "$(dirname "$0")/.."
# shellcheck disable=SC1091
. tools/env.sh
export RBPF_FUZZ_S=${1:-60}
for program in test_rbpf_core test_rbpf_node; do
  "build/devel/lib/rbpf_svgp_slam/$program" --gtest_filter='Fuzzed*' --gtest_brief=1
done
python3 -m pytest -q -p no:cacheprovider test/python/test_fuzzed_files.py
