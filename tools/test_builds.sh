#!/usr/bin/env bash
# Builds the committed tree in a catkin workspace and with colcon, and starts what was installed;
# evo, cmocean and pyxtf are installed there from what tools/setup.sh --test has fetched.
set -euo pipefail
cd "$(dirname "$0")/.."
export PATH=/usr/bin:/bin:$PATH
root=$PWD
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# None: this is about the build's description, not about the program's speed or its debugging.
# ccache: what catkin has compiled, colcon need not compile again.
options=(-DPYTHON_EXECUTABLE=/usr/bin/python3 -DCATKIN_ENABLE_TESTING=OFF -DCMAKE_BUILD_TYPE=None
  -DCMAKE_CXX_COMPILER_LAUNCHER=ccache)
export CCACHE_DIR=$root/build/ccache

mkdir -p "$work/catkin/src/rbpf_svgp_slam" "$work/colcon/src/rbpf_svgp_slam"
for kind in catkin colcon; do
  git ls-files -z | xargs -0 cp --parents -t "$work/$kind/src/rbpf_svgp_slam"
done

# A run of another program, trajectories alone, for evo to score.
mkdir "$work/run"
for second in 0 1 2 3 4; do
  echo "$second 0 $second -5 0 0 0 1" >>"$work/run/ground_truth.tum"
  echo "$second 1 $second -5 0 0 0 1" >>"$work/run/trajectory.tum"
done

check() {
  (
    set +u
    . "$1"
    export PIP_NO_INDEX=1 PIP_FIND_LINKS=$root/build/wheels
    tools/requirements.sh
    rosrun rbpf_svgp_slam evaluate_run.py "$work/run" | grep "evo .* agrees with ours" >/dev/null
    python3 -c "
from rbpf_svgp_slam.figures.figure_style import DEPTH_MAP
assert DEPTH_MAP.name == 'deep_r', DEPTH_MAP.name"
    roslaunch --files rbpf_svgp_slam replay.launch bag:=x out:=y check:=false >/dev/null
    rosrun rbpf_svgp_slam simulate_survey.py --help >/dev/null
  )
}

(cd "$work/catkin" && CCACHE_BASEDIR=$PWD catkin_make -j"$(nproc)" "${options[@]}" install >make.log 2>&1) ||
  { cat "$work/catkin/make.log"; exit 1; }
check "$work/catkin/devel/setup.bash"
check "$work/catkin/install/setup.bash"
echo "catkin workspace: built and installed"

# where catkin_make has its generated headers: another path to them would not be found in the cache
(cd "$work/colcon" && CCACHE_BASEDIR=$PWD "$root/build/venv/bin/colcon" --log-base log build \
  --cmake-args "${options[@]}" -DCATKIN_DEVEL_PREFIX="$work/colcon/devel" >build.log 2>&1) || { cat "$work/colcon/build.log"; exit 1; }
check "$work/colcon/install/setup.bash"
echo "colcon build: built"
