#!/usr/bin/env python3
"""Simulate a multibeam survey and write it as a rosbag; see --help."""

import sys

from rbpf_svgp_slam.simulation.simulate_command import main

if __name__ == "__main__":
    sys.exit(main())
