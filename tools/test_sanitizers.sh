#!/usr/bin/env bash
# Builds the core, the library gmrf and their tests with sanitizers, and runs them.
#   tools/test_sanitizers.sh RESULTS [TEST ...]
#       RESULTS: folder for gtest's XML; by default test_rbpf_core and test_gmrf. The smoother's,
#       test_smoothing, take five minutes of building and running more, and start no threads.
set -euo pipefail
cd "$(dirname "$0")/.."
export PATH=/usr/bin:/bin:$PATH
results=$1
shift
[ $# -gt 0 ] || set -- test_rbpf_core test_gmrf
# Statistics over many seeds: one thread does the same thousands of times, of which a sanitizer learns nothing.
statistics=Observability.*:MotionNoise.*:TwistAgainstPose.PassesLongSurveysOfManySeeds
# What one thread does on its own, and takes long: there is nothing for the thread sanitizer to see.
single=DamagedJournal.*:FuzzedJournal.*:MapBytes.*:MostEvident.*:TwistAgainstPose.*
# a sourced workspace would put its own librbpf_core.so, without sanitizers, before ours
unset LD_LIBRARY_PATH CMAKE_PREFIX_PATH

for sanitizers in thread address,undefined; do
  export GTEST_FILTER=-$statistics
  [ $sanitizers = thread ] && GTEST_FILTER+=:$single
  build=build/sanitize/${sanitizers//,/_}  # a comma would split the linker's arguments
  mkdir -p "$build"
  {
    # -g1: all that a sanitizer's report names; with -g, compiling takes half as long again
    # several files at once: gtest and Eigen are read once for all of them
    cmake -S . -B "$build" -DPYTHON_EXECUTABLE=/usr/bin/python3 -DCMAKE_BUILD_TYPE=Debug \
      -DCMAKE_UNITY_BUILD=ON -DCMAKE_UNITY_BUILD_BATCH_SIZE=8 \
      -DCMAKE_CXX_FLAGS_DEBUG="-O1 -g1" -DRBPF_SANITIZE="$sanitizers"
    cmake --build "$build" --parallel "$(nproc)" --target "$@"
  } >"$build/build.log" 2>&1 || { cat "$build/build.log"; exit 1; }
  echo "-- $sanitizers"
  for test in "$@"; do
    # a share of the tests for each core
    shards=()
    for ((shard = 0; shard < $(nproc); shard++)); do
      GTEST_TOTAL_SHARDS=$(nproc) GTEST_SHARD_INDEX=$shard \
        "$build/devel/lib/rbpf_svgp_slam/$test" --gtest_brief=1 \
        --gtest_output="xml:$results/$test.${sanitizers//,/_}.$shard.xml" &
      shards+=($!)
    done
    for shard in "${shards[@]}"; do
      wait "$shard"
    done
  done
done
