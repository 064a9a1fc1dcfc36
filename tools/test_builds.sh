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
# Several files at once, whose headers are read once. ccache: what catkin has compiled, colcon, with
# the same paths, need not compile again.
options=(-DPYTHON_EXECUTABLE=/usr/bin/python3 -DCATKIN_ENABLE_TESTING=OFF -DCMAKE_BUILD_TYPE=None
  -DCMAKE_UNITY_BUILD=ON -DCMAKE_UNITY_BUILD_BATCH_SIZE=8 -DCMAKE_CXX_COMPILER_LAUNCHER=ccache)
export CCACHE_DIR=$root/build/ccache CCACHE_BASEDIR=$work/workspace

mkdir -p "$work/workspace/src/rbpf_svgp_slam"
git ls-files -z | xargs -0 cp --parents -t "$work/workspace/src/rbpf_svgp_slam"

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
    "$root/tools/requirements.sh"
    rosrun rbpf_svgp_slam evaluate_run.py "$work/run" | grep "evo .* agrees with ours" >/dev/null
    python3 -c "
from rbpf_svgp_slam.figures.figure_style import DEPTH_MAP
assert DEPTH_MAP.name == 'deep_r', DEPTH_MAP.name"
    roslaunch --files rbpf_svgp_slam replay.launch bag:=x out:=y check:=false >/dev/null
    rosrun rbpf_svgp_slam simulate_survey.py --help >/dev/null
  )
}

cd "$work/workspace"
catkin_make -j"$(nproc)" "${options[@]}" install >make.log 2>&1 || { cat make.log; exit 1; }
check "$work/workspace/devel/setup.bash"
check "$work/workspace/install/setup.bash"
echo "catkin workspace: built and installed"

# where catkin_make has its generated headers: another path to them would not be found in the cache
mkdir "$work/catkin"
mv build devel install "$work/catkin"
"$root/build/venv/bin/colcon" --log-base log build --base-paths src \
  --cmake-args "${options[@]}" -DCATKIN_DEVEL_PREFIX="$work/workspace/devel" >build.log 2>&1 ||
  { cat build.log; exit 1; }
check "$work/workspace/install/setup.bash"
echo "colcon build: built"
