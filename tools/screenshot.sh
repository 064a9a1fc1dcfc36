#!/usr/bin/env bash
# Shows the demo's survey in RViz under a virtual display, takes a picture every so many seconds, and
# makes a time lapse of them.
#   tools/screenshot.sh DIR [ENGINE [RATE]]
#   DIR/frames/001.png ..., DIR/time_lapse.gif; svgp, played 2 times faster than it was made
# docs/rviz.gif is the time lapse of svgp at rate 4. The pictures in docs/ are frames chosen by hand,
# made smaller with convert -resize 1200x -colors 200 +dither: when something happens depends on how
# fast the machine is.
set -euo pipefail
cd "$(dirname "$0")/.."
dir=${1:?"expected a folder for the pictures"}
engine=${2:-svgp}
rate=${3:-2}
pictures=80  # of 20 minutes of survey
period_s=$((1200 / rate / pictures))
tools/setup.sh

rm -rf "$dir/frames"
mkdir -p "$dir/frames"
export DISPLAY=:87 LIBGL_ALWAYS_SOFTWARE=1
Xvfb "$DISPLAY" -screen 0 1500x900x24 >/dev/null 2>&1 &
xvfb=$!
setsid tools/demo.sh --rviz --engine "$engine" --rate "$rate" "$dir/demo" &
demo=$!
trap 'kill -TERM -- -$demo 2>/dev/null || true; kill $xvfb' EXIT

next=$dir/next.png
k=0
while kill -0 "$demo" 2>/dev/null; do
  sleep "$period_s"
  import -window root "$next"
  # black before RViz is there, and after it has gone
  [ "$(identify -format '%[max]' "$next")" = 0 ] && continue
  k=$((k + 1))
  mv "$next" "$(printf %s/frames/%03d.png "$dir" "$k")"
done
rm -f "$next"

# The time lapse is of what RViz draws, with its panel "Status" in a corner.
scene=1120x808+364+62
status=342x208+0+662
frames=("$dir"/frames/*.png)
scenes=()
for ((i = 0; i < ${#frames[@]}; i += 1 + ${#frames[@]} / 60)); do
  scenes+=("(" "${frames[i]}" -crop "$scene" +repage
    "(" "${frames[i]}" -crop "$status" +repage ")" -composite -resize 760x ")")
done
convert -delay 25 "${scenes[@]}" -loop 0 +dither -colors 64 -layers optimize "$dir/time_lapse.gif"
ls -l "$dir/time_lapse.gif"
