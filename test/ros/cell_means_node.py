#!/usr/bin/env python3
"""A map node as svgp_node.py starts it, with one more engine in the registry."""

import sys

from rbpf_svgp_slam.maps import ENGINES

if __name__ == "__main__":
    ENGINES["cell_means"] = ("cell_means", "CellMeans")
    # Here, since the parameters' rules are made of the registry when they are imported.
    from rbpf_svgp_slam.map_node.start import start

    sys.exit(start())
