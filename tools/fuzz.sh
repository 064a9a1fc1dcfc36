#!/usr/bin/env bash
# Fuzzes what reads bytes, and running nodes, for longer than the tests do; says at the end what has
# been tried, and fails if anything has crashed.
#   tools/fuzz.sh [SECONDS [TARGET ...]]    of each target, 60 by default
# messages, journal, map: libFuzzer, which looks for bytes that lead to code where none have been
# before, under AddressSanitizer and UndefinedBehaviorSanitizer. files, core, map_node: the tests'
# own fuzzers, of a map's or a run's files in Python, of a running core's topics and services, and of
# a map node's services. What crashes is kept in build/fuzz/crashes, for
#   build/fuzz/devel/lib/rbpf_svgp_slam/fuzz_TARGET FILE
# and what has led further in build/fuzz/corpus, from where the next time goes on.
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-60}
targets=("${@:2}")
[ ${#targets[@]} -gt 0 ] || targets=(messages journal map files core map_node)
tools/setup.sh --fuzz
export PATH=/usr/bin:/bin:$PATH
fuzz=build/fuzz
programs=$fuzz/devel/lib/rbpf_svgp_slam
mkdir -p $fuzz

build() (
  # a sourced workspace would put its own librbpf_core.so, without sanitizers, before ours
  unset LD_LIBRARY_PATH CMAKE_PREFIX_PATH
  {
    [ -f $fuzz/Makefile ] || cmake -S . -B $fuzz -DPYTHON_EXECUTABLE=/usr/bin/python3 -DCMAKE_BUILD_TYPE=Debug \
      -DCMAKE_C_COMPILER=clang-14 -DCMAKE_CXX_COMPILER=clang++-14 \
      -DCMAKE_CXX_FLAGS_DEBUG="-O1 -g1" -DCATKIN_ENABLE_TESTING=OFF \
      -DRBPF_SANITIZE=address,undefined -DRBPF_FUZZ=ON
    cmake --build $fuzz --parallel "$(nproc)" --target fuzzers
    $programs/write_seeds $fuzz/seeds
  } >$fuzz/build.log 2>&1 || { cat $fuzz/build.log; return 1; }
)

# The last match of a sed expression in a target's log.
last() { sed -nE "s/$2/\1/p" "$fuzz/$1.log" | tail -n 1; }

guided() {
  local ended=0
  build || return 1
  mkdir -p "$fuzz/corpus/$1" $fuzz/crashes
  env -u LD_LIBRARY_PATH "$programs/fuzz_$1" "$fuzz/corpus/$1" "$fuzz/seeds/$1" \
    -max_total_time="$seconds" -timeout=60 -rss_limit_mb=2048 -malloc_limit_mb=512 \
    -use_value_profile=1 -print_final_stats=1 -artifact_prefix="$fuzz/crashes/$1-" \
    >"$fuzz/$1.log" 2>&1 || ended=$?
  echo "$1: $(last "$1" '.*number_of_executed_units: *([0-9]+)') executed," \
    "$(last "$1" '.* cov: ([0-9]+) .*') of" \
    "$(last "$1" '.*Loaded [0-9]+ modules +\(([0-9]+) .*') edges covered," \
    "at most $(last "$1" '.*peak_rss_mb: *([0-9]+)') MB"
  [ $ended = 0 ] || grep -v '^#' "$fuzz/$1.log" | tail -n 60
  return $ended
}

# A quarter of the time for each of its tests.
files() {
  RBPF_FUZZ_S=$((seconds / 4)) python3 -m pytest -q -s -p no:cacheprovider \
    test/python/test_fuzzed_files.py
}

node() {
  local results=$ROOT/$fuzz/results/$1
  rm -rf "$results"
  RBPF_FUZZ_S=$seconds rostest --results-base-dir="$results" "test/ros/$1.test" \
    >"$fuzz/$1.log" 2>&1 || { tail -n 60 "$fuzz/$1.log"; return 1; }
  grep -rhE "^(core|map node): " "$results"
}

# shellcheck disable=SC1091
. tools/env.sh
failed=0
for target in "${targets[@]}"; do
  case $target in
    messages | journal | map) guided "$target" || failed=1 ;;
    files) files || failed=1 ;;
    core) node core || failed=1 ;;
    map_node) node resampling || failed=1 ;;
    *)
      echo "$target is no target"
      failed=1
      ;;
  esac
done
exit $failed
