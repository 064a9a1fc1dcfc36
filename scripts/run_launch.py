#!/usr/bin/env python3
"""Runs one of this package's launch files and tells by its exit status how it went; see --help."""

import sys

from rbpf_svgp_slam.recorder.launch_status import main

if __name__ == "__main__":
    sys.exit(main())
