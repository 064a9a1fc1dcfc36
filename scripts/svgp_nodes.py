#!/usr/bin/env python3
"""Starts the map nodes of this host: all that the parameter `nodes` says, or some of them."""

import sys

from rbpf_svgp_slam.map_node.launcher import start_map_nodes

if __name__ == "__main__":
    sys.exit(start_map_nodes(sys.argv[1:]))
