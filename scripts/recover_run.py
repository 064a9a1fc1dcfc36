#!/usr/bin/env python3
"""Makes the run folder of an interrupted survey from its journal; see --help."""

import sys

from rbpf_svgp_slam.evaluation.recover_run import main

if __name__ == "__main__":
    sys.exit(main())
