#!/usr/bin/env python3
"""Follows a survey and writes its run folder; see rbpf_svgp_slam/recorder/recorder.py."""

import sys

from rbpf_svgp_slam.recorder.recorder import start

if __name__ == "__main__":
    sys.exit(start())
