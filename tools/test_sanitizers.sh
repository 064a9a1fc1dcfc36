#!/usr/bin/env bash
# Builds the core, the library gmrf and their tests with sanitizers, and runs them.
#   tools/test_sanitizers.sh RESULTS     RESULTS: folder for gtest's XML
set -euo pipefail
cd "$(dirname "$0")/.."
export PATH=/usr/bin:/bin:$PATH
results=$1
# a sourced workspace would put its own librbpf_core.so, without sanitizers, before ours
unset LD_LIBRARY_PATH CMAKE_PREFIX_PATH

for sanitizers in thread address,undefined; do
  tests="test_rbpf_core test_gmrf"
  # The smoother starts no threads.
  [ "$sanitizers" = thread ] || tests="$tests test_smoothing"
  build=build/sanitize/${sanitizers//,/_}  # a comma would split the linker's arguments
  mkdir -p "$build"
  {
    # -g1: all that a sanitizer's report names; with -g, compiling takes half as long again
    cmake -S . -B "$build" -DPYTHON_EXECUTABLE=/usr/bin/python3 -DCMAKE_BUILD_TYPE=Debug \
      -DCMAKE_CXX_FLAGS_DEBUG="-O1 -g1" -DRBPF_SANITIZE="$sanitizers"
    # shellcheck disable=SC2086  # one target a word
    cmake --build "$build" --parallel "$(nproc)" --target $tests
  } >"$build/build.log" 2>&1 || { cat "$build/build.log"; exit 1; }
  echo "-- $sanitizers"
  for test in $tests; do
    # Without the smoother's statistics over many surveys, whose code the other tests run too.
    "$build/devel/lib/rbpf_svgp_slam/$test" --gtest_brief=1 \
      --gtest_filter=-*CorrectsThePast:*LeavesDeadReckoningAlone:*LittleRelief:*AmongOutliers:*ErrsAsAtOnce \
      --gtest_output="xml:$results/$test.${sanitizers//,/_}.xml"
  done
done
