#!/usr/bin/env python3
"""Plays a survey's bag for replay.launch; see rbpf_svgp_slam/bags/player.py."""

import sys

from rbpf_svgp_slam.bags.player import play

if __name__ == "__main__":
    sys.exit(play(sys.argv[1:]))
