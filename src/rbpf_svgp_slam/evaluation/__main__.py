"""Prints the summary of a run folder: python3 -m rbpf_svgp_slam.evaluation DIR."""

import json
import sys
from pathlib import Path

from rbpf_svgp_slam.evaluation.result_lines import summarise

folder = Path(sys.argv[1])
print(summarise(json.loads((folder / "report.json").read_text()), folder))
