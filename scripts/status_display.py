#!/usr/bin/env python3
"""Shows how a survey goes, in RViz; see rbpf_svgp_slam/display/status_display.py."""

from rbpf_svgp_slam.display.status_display import start

if __name__ == "__main__":
    start()
