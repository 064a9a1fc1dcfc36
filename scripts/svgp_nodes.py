#!/usr/bin/env python3
"""Starts the B map nodes on this machine, as many as the parameter `nodes` says."""

import sys

from rbpf_svgp_slam.ros.node_group import start_map_nodes

if __name__ == "__main__":
    sys.exit(start_map_nodes())
