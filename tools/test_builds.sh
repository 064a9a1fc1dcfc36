#!/usr/bin/env bash
# Builds the committed tree in a catkin workspace and with colcon, and starts what was installed.
set -euo pipefail
cd "$(dirname "$0")/.."
export PATH=/usr/bin:/bin:$PATH
root=$PWD
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# debug: this is about the build's description, not about its speed
options=(-DPYTHON_EXECUTABLE=/usr/bin/python3 -DCATKIN_ENABLE_TESTING=OFF -DCMAKE_BUILD_TYPE=Debug)

mkdir -p "$work/catkin/src/rbpf_svgp_slam" "$work/colcon/src/rbpf_svgp_slam"
for kind in catkin colcon; do
  git ls-files -z | xargs -0 cp --parents -t "$work/$kind/src/rbpf_svgp_slam"
done

check() {
  (
    set +u
    . "$1"
    roslaunch --files rbpf_svgp_slam replay.launch bag:=x out:=y >/dev/null
    rosrun rbpf_svgp_slam simulate_survey.py --help >/dev/null
  )
}

(cd "$work/catkin" && catkin_make -j"$(nproc)" "${options[@]}" >make.log 2>&1) ||
  { cat "$work/catkin/make.log"; exit 1; }
check "$work/catkin/devel/setup.bash"
echo "catkin workspace: built"

(cd "$work/colcon" && "$root/build/venv/bin/colcon" --log-base log build --cmake-args "${options[@]}" \
  >build.log 2>&1) || { cat "$work/colcon/build.log"; exit 1; }
check "$work/colcon/install/setup.bash"
echo "colcon build: built"
