#!/usr/bin/env bash
# Simulates a 20-minute survey, replays it through the live nodes and writes the run folder.
#   tools/demo.sh [--rviz] [--seed N] [--engine svgp|gmrf] [--rate R] [DIR]
# R: times real time, 12; fewer on a machine that has other work. DIR: out/demo by default. The
# simulated seabed is placed in the sea west of Sweden, so that there are products: DIR/export.
set -euo pipefail
cd "$(dirname "$0")/.."
tools/setup.sh
. tools/env.sh

rate=12
seed=1
rviz=false
config=demo  # of the engine svgp
out=
while [ $# -gt 0 ]; do
  case $1 in
    --rviz) rviz=true ;;
    --seed)
      seed=${2:?"--seed: expected a number"}
      shift
      ;;
    --engine)
      case ${2:-} in
        svgp) config=demo ;;
        gmrf) config=gmrf ;;
        *)
          echo "demo.sh: --engine: expected svgp or gmrf" >&2
          exit 2
          ;;
      esac
      shift
      ;;
    --rate)
      rate=${2:?"--rate: expected a number"}
      shift
      ;;
    -*)
      echo "demo.sh: unknown option $1, expected --rviz, --seed N, --engine, --rate R or a folder" >&2
      exit 2
      ;;
    *) out=$1 ;;
  esac
  shift
done
out=$(realpath -m "${out:-out/demo}")
mkdir -p "$out"

echo "Simulating the survey (seed $seed) ..."
rosrun rbpf_svgp_slam simulate_survey.py --mission demo --seed "$seed" \
  --origin 57.5 11.2 --out "$out/survey.bag"
echo "Replaying it $rate times faster than it was made ..."
rosrun rbpf_svgp_slam run_launch.py replay.launch \
  bag:="$out/survey.bag" survey:="$out/survey.survey.yaml" terrain:="$out/survey.terrain.npz" \
  config:="$ROOT/config/$config.yaml" out:="$out" rate:="$rate" rviz:="$rviz" \
  overwrite:=true
