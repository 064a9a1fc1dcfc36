#!/usr/bin/env python3
"""Smooth the past of a run folder: navigation adjusted by what its passes tell; see --help."""

import sys

from rbpf_svgp_slam.evaluation.smooth_survey import main

if __name__ == "__main__":
    sys.exit(main())
