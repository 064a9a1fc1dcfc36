#!/usr/bin/env python3
"""Make drifting dead reckoning of a bag's good navigation; see --help."""

import sys

from rbpf_svgp_slam.importers.degraded_bag import main

if __name__ == "__main__":
    sys.exit(main())
