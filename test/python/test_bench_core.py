"""The core's benchmarks in small, and what they promise that does not depend on the machine."""

import json
import subprocess
import sys

import pytest

from bench.core import program, scaling
from bench.paths import ROOT

pytestmark = pytest.mark.alone

# With the constants of a full run these sections take minutes.
SMALL_PROMPTS = """
import json, sys
from pathlib import Path
import bench.core.filter_session as session
import bench.core.prompts as prompts
session.S, session.M = 36, 100
prompts.PARTICLES, prompts.REPEATS, prompts.OPTIMIZERS = 5, 2, ("streaming",)
prompts.BEAMS, prompts.NEW_BEAMS, prompts.PAUSE_S, prompts.STEPS = 5000, 1000, 0.5, 3
Path(sys.argv[1], "figures.json").write_text(json.dumps(prompts.run(Path(sys.argv[1]))))
"""


@pytest.mark.parametrize("resamplings", [0, 1000])
def test_log_and_histories_of_the_largest_survey_fit(resamplings):
    measured = program.run("bench_memory", str(resamplings))
    assert (measured["beams"], measured["pings"]) == (12_400_000, 50_000)
    # without a resampling nothing is shared: as many poses as J x pings
    assert (measured["stored_poses"] == 5_000_000) == (resamplings == 0)
    # 16 bytes a beam and 24 a pose cannot be undercut; 450 MB is what they were given
    smallest_mb = (12.4e6 * 16 + measured["stored_poses"] * 24) / 1e6
    assert smallest_mb < measured["resident_mb"] < 450


def test_numbering_moves_fewer_maps():
    for traffic in program.run("bench_weights_and_numbering")["numbering"].values():
        assert 0 < traffic["ours"] < 0.5 * traffic["plain"]
        assert traffic["replaced_share"] == pytest.approx(0.5, abs=0.05)


def test_prompts_and_resamplings_of_the_stand_in_core(tmp_path):
    subprocess.run([sys.executable, "-c", SMALL_PROMPTS, tmp_path], cwd=ROOT, check=True)
    figures = json.loads((tmp_path / "figures.json").read_text())
    assert figures["prompt_s_j100"] > 0.0 and figures["resampling_s_j100"] > 0.0
    measured = figures["prompts"]["streaming"]
    assert "closing loops" in measured["outcomes"]
    assert measured["maps_moved"] >= 0.5  # 5 particles on 2 nodes, odd shares
    assert measured["bytes_moved"] > 1000 * measured["maps_moved"]


def test_scaling_table_has_a_row_for_each_measurement():
    row = {"particles": 100, "nodes": 2, "beams": 12_400_000, "steps_per_s": 160.4}
    row |= {"prompt_s": 0.25, "resampling_s": 0.1, "maps_moved": 6.3}
    row |= {"core_rss_mb": 301.2, "largest_node_rss_mb": 588.0}
    lines = scaling._table([row, row]).splitlines()
    assert len(lines) == 4
    assert lines[2] == "| 100 | 2 | 1.24e+07 | 160 | 0.250 | 0.100 | 6.3 | 301 | 588 |"
    assert {line.count("|") for line in lines} == {10}
