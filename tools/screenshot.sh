#!/usr/bin/env bash
# Takes docs/rviz.png: the demo's survey in RViz under a virtual display, at a share of its way.
#   tools/screenshot.sh [PNG] [SECONDS after the start of the demo]
set -euo pipefail
cd "$(dirname "$0")/.."
png=${1:-docs/rviz.png}
after_s=${2:-150}
tools/setup.sh

export DISPLAY=:87 LIBGL_ALWAYS_SOFTWARE=1
Xvfb "$DISPLAY" -screen 0 1500x900x24 >/dev/null 2>&1 &
xvfb=$!
tools/demo.sh --rviz "$(mktemp -d)" &
demo=$!
trap 'kill $demo $xvfb 2>/dev/null || true' EXIT
sleep "$after_s"
import -window root "$png"
echo "$png"
kill -INT $demo
wait $demo || true
