#!/usr/bin/env python3
"""Runs rbpf_core, and again if it is killed; see rbpf_svgp_slam/keeper/core_keeper.py."""

import sys

from rbpf_svgp_slam.keeper.core_keeper import keep_core

if __name__ == "__main__":
    sys.exit(keep_core(sys.argv[1:]))
