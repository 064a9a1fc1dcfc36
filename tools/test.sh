#!/usr/bin/env bash
# Sets up, checks the style, runs gtest (also under sanitizers), pytest and rostest, and ends with
# the counts.
set -euo pipefail
cd "$(dirname "$0")/.."
tools/setup.sh --test
. tools/env.sh

results=$ROOT/build/test_results
rm -rf "$results"
mkdir -p "$results"
failed=0
step() {
  echo "== $1"
  shift
  "$@" || failed=1
}

mapfile -t cpp < <(git ls-files '*.cpp' '*.hpp')
mapfile -t python < <(git ls-files '*.py' 'scripts/*')
step "style" clang-format --dry-run --Werror "${cpp[@]}"
step "style" black --check --quiet "${python[@]}"
step "style" python3 -m flake8 "${python[@]}"
# the scripts in tools/ are for the source tree only
step "style" catkin_lint -W1 --strict --offline --ignore uninstalled_script .

build_tests() {
  cmake --build build --parallel "$(nproc)" --target tests >build/build.log 2>&1 ||
    { cat build/build.log; return 1; }
}
step "build the tests" build_tests
for binary in build/devel/lib/rbpf_svgp_slam/test_*; do
  name=$(basename "$binary")
  step "gtest $name" "$binary" --gtest_brief=1 --gtest_output="xml:$results/$name.xml"
done
run_pytest() {
  python3 -m pytest -q -rs -p no:cacheprovider --junitxml="$results/pytest_$1.xml" "${@:2}"
}
# by file: what a module's tests share is made once
step "pytest" run_pytest together -m "not alone" --numprocesses="$(nproc)" --dist=loadfile
# What only computes goes on behind what mostly waits, on processors that are idle otherwise
# (SCHED_IDLE); in a session of its own, so that it ends with this script, compilers and all.
setsid chrt --idle 0 bash -c '
  # and as a session: Linux shares processors between sessions before it looks at what is idle
  echo 19 2>/dev/null >/proc/self/autogroup || true
  tools/test_sanitizers.sh "$0" >"$0/sanitizers.log" 2>&1
  sanitizers=$?
  tools/test_builds.sh >"$0/builds.log" 2>&1 && exit $sanitizers' "$results" &
behind=$!
trap 'kill -- "-$behind" 2>/dev/null || true' EXIT
step "pytest" run_pytest alone -m alone
run_rostest() {
  # bash has its background jobs ignore SIGINT, with which roslaunch ends its nodes
  env --default-signal=INT rostest --results-base-dir="$results" --results-filename="$1.xml" \
    "test/ros/$1.test"
}
# What an offline replay gives does not depend on what the machine does meanwhile, and both wait as
# long as they compute. rostest gives each a master of its own.
surveys_beside_offline() {
  local offline passed=true
  run_rostest offline >"$results/offline.log" 2>&1 &
  offline=$!
  run_rostest surveys || passed=false
  wait "$offline" || passed=false
  cat "$results/offline.log"
  $passed
}
for file in test/ros/*.test; do
  name=$(basename "$file" .test)
  case $name in
    offline | surveys) ;;
    *) step "rostest $name" run_rostest "$name" ;;
  esac
done
step "rostest surveys, offline" surveys_beside_offline

end_of_behind() {
  local passed=true
  wait "$behind" || passed=false
  cat "$results/sanitizers.log" "$results/builds.log"
  $passed
}
step "sanitizers, other builds" end_of_behind

python3 tools/count_tests.py "$results" || failed=1
exit $failed
