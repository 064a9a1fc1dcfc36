#!/usr/bin/env python3
"""Export a run folder for charts, GIS and navigation processing; see --help."""

import sys

from rbpf_svgp_slam.exports.export_map import main

if __name__ == "__main__":
    sys.exit(main())
