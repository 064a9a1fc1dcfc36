#!/usr/bin/env python3
"""Compute the metrics of a run folder anew, also by evo, and compare; see --help."""

import sys

from rbpf_svgp_slam.evaluation.evaluate_run import main

if __name__ == "__main__":
    sys.exit(main())
