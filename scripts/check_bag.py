#!/usr/bin/env python3
"""Say what SLAM would meet in a bag, and write the overlay for it; see --help."""

import sys

from rbpf_svgp_slam.checking.check_bag import main

if __name__ == "__main__":
    sys.exit(main())
