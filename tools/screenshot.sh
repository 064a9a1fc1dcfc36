#!/usr/bin/env bash
# Takes docs/rviz.png: the demo's survey in RViz under a virtual display, halfway through.
#   tools/screenshot.sh [PNG] [SECONDS after the start of the demo] [ENGINE]
#                       docs/rviz.png, 170, svgp
set -euo pipefail
cd "$(dirname "$0")/.."
png=${1:-docs/rviz.png}
after_s=${2:-170}
engine=${3:-svgp}
tools/setup.sh

export DISPLAY=:87 LIBGL_ALWAYS_SOFTWARE=1
Xvfb "$DISPLAY" -screen 0 1500x900x24 >/dev/null 2>&1 &
xvfb=$!
setsid tools/demo.sh --rviz --engine "$engine" "$(mktemp -d)" &
demo=$!
trap 'kill -TERM -- -$demo 2>/dev/null; kill $xvfb' EXIT
sleep "$after_s"
import -window root "$png"
echo "$png"
