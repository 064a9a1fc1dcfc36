#!/usr/bin/env python3
"""Starts a map node; private parameter ~index: which of the nodes it is, 0 .. B-1."""

import sys

from rbpf_svgp_slam.map_node.start import start

if __name__ == "__main__":
    sys.exit(start())
