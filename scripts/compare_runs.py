#!/usr/bin/env python3
"""Lay the reports of several runs side by side; see --help."""

import sys

from rbpf_svgp_slam.evaluation.compare_runs import main

if __name__ == "__main__":
    sys.exit(main())
