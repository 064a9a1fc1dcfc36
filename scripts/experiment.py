#!/usr/bin/env python3
"""Carries out one of the paper's experiments; see rbpf_svgp_slam/experiments."""

import sys

from rbpf_svgp_slam.experiments.experiment_command import main

if __name__ == "__main__":
    sys.exit(main())
