#!/usr/bin/env python3
"""Make a survey's bag of the files of a multibeam echosounder; see --help."""

import sys

from rbpf_svgp_slam.importers.import_command import main

if __name__ == "__main__":
    sys.exit(main())
