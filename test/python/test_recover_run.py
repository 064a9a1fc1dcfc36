"""A run folder from a journal, which is written here by what its format says, not by our writer."""

import json
import struct
import xmlrpc.client
import zlib

import numpy as np
import pytest

from rbpf_svgp_slam import _journal
from rbpf_svgp_slam.evaluation.recover_run import main
from rbpf_svgp_slam.parameters.known import default_parameters
from rbpf_svgp_slam.run.run_files import load_run
from rbpf_svgp_slam.run.tracks import read_tum, write_tum

PINGS, BEAMS, HZ, SPEED_MPS = 120, 64, 2.0, 2.0
FILTER_SETTINGS, PROGRAM_SETTINGS, ODOMETRY, PING = range(4)
#: Particles without noise: all of them follow the odometry.
SETTINGS = """particles 3
seed 1
start/pose none
start/position_std_m 0
start/yaw_std_rad 0
odometry/velocity auto
odometry/gap_s 2
odometry/max_bridge_s 10
motion/surge_std_m 0
motion/sway_std_m 0
motion/yaw_std_rad 0
pings/min_range_m 0.5
pings/max_range_m 500
pings/outlier_window 0
pings/outlier_threshold 8
pings/queue 200
fixes/max_sigmas 5
fixes/drift_mps 0.02
fixes/max_late_s 10
fixes/max_std_m 1000
mapping/hold_back_s 30
mapping/common_random_numbers false
evaluation/holdout 0.1
survey_area/centre_x_m 60
survey_area/centre_y_m 0
"""


def record(kind, content):
    head = struct.pack("<IB", len(content), kind)
    return head + content + struct.pack("<I", zlib.crc32(head + content))


def text(content):
    return struct.pack("<Q", len(content)) + content.encode()


def odometry(stamp_s):
    """Along x from the origin, 5 m below the surface."""
    pose, attitude = (SPEED_MPS * (stamp_s - 100.0), 0.0, 0.0), (-5.0, 0.0, 0.0)
    twist = (SPEED_MPS, 0.0, 0.0, 0.0, 0.0, 0.0)
    return record(ODOMETRY, struct.pack("<13d", stamp_s, *pose, *attitude, *twist))


def ping(stamp_s):
    """Across the track, over seabed that rises to the left."""
    y = np.linspace(-20.0, 20.0, BEAMS)
    beams = np.column_stack([np.zeros(BEAMS), y, -15.0 + 0.1 * y]).astype("<f4")
    head = struct.pack("<d?3fQ", stamp_s, False, 0.0, 0.0, 0.0, BEAMS)
    return record(PING, head + beams.tobytes())


def write_journal(folder, tail=b""):
    config = default_parameters()
    config["survey_area"] = [[0.0, -20.0], [120.0, -20.0], [120.0, 20.0], [0.0, 20.0]]
    config["particles"] = 3
    xml = xmlrpc.client.dumps((config,)).split("<param>")[1].split("</param>")[0]
    stamps_s = 100.0 + np.arange(PINGS) / HZ
    records = [
        record(FILTER_SETTINGS, text(SETTINGS)),
        record(PROGRAM_SETTINGS, struct.pack("<Q", 1) + text(xml)),
    ]
    for stamp_s in stamps_s:
        records += [odometry(stamp_s), ping(stamp_s)]
    head = b"RBPFJRNL" + struct.pack("<I", _journal.FORMAT_VERSION)
    (folder / "survey.journal").write_bytes(head + b"".join(records) + tail)
    return stamps_s


def test_a_run_folder_is_made_of_the_journal_alone(tmp_path, capsys):
    stamps_s = write_journal(tmp_path)
    assert main([str(tmp_path)]) == 0
    run = load_run(tmp_path)
    np.testing.assert_allclose(run.stamp_s, stamps_s)
    along = SPEED_MPS * (stamps_s - 100.0)
    for track in (run.estimate, run.online, run.dead_reckoning):
        np.testing.assert_allclose(track[:, 0], along, atol=1e-6)
        np.testing.assert_allclose(track[:, 2], -5.0)
    assert run.levelled.shape == (PINGS * BEAMS, 3)
    assert run.held_out.sum() == PINGS // 10
    known = np.isfinite(run.map.mean)
    assert known.mean() > 0.9
    slope = -20.0 + 0.1 * np.broadcast_to(run.map.y, run.map.mean.shape)
    assert np.abs(run.map.mean - slope)[known].max() < 0.1  # m; no noise in the beams
    report = json.loads((tmp_path / "report.json").read_text())
    assert (report["pings"], report["particles"], report["ate_rmse_m"]) == (PINGS, 3, None)
    assert report["health"] == {"core_resumed": 0, "journal": "whole"}
    assert (tmp_path / "report.html").is_file()
    assert f"{PINGS} pings from {2 + 2 * PINGS} records" in capsys.readouterr().out


def test_the_journal_tells_the_particles_and_their_weights(tmp_path):
    write_journal(tmp_path)
    survey = _journal.read(str(tmp_path / "survey.journal"))
    np.testing.assert_allclose(survey["particles"][:, 0], survey["online"][-1, 0], atol=1e-6)
    assert survey["particles"].shape == (3, 3)
    np.testing.assert_allclose(survey["log_weights"], np.log(np.full(3, 1.0 / 3.0)))


def test_ground_truth_in_the_folder_scores_it_and_it_may_be_made_again(tmp_path, capsys):
    stamps_s = write_journal(tmp_path, tail=b"power")
    truth = np.zeros((len(stamps_s), 6))
    truth[:, 0], truth[:, 1], truth[:, 2] = SPEED_MPS * (stamps_s - 100.0), 0.5, -5.0
    write_tum(tmp_path / "ground_truth.tum", stamps_s, truth)
    for _ in range(2):
        assert main([str(tmp_path)]) == 0
        report = json.loads((tmp_path / "report.json").read_text())
        assert report["ate_rmse_m"] == pytest.approx(0.5, abs=1e-6)
        assert report["health"]["journal"].startswith("lost: the last 5 bytes")
        assert "lost: the last 5 bytes, the file ends within a record" in capsys.readouterr().out
    assert len(read_tum(tmp_path / "trajectory.tum")[0]) == PINGS


def test_a_run_that_was_written_at_its_end_is_kept(tmp_path, capsys):
    write_journal(tmp_path)
    (tmp_path / "report.json").write_text("{}")
    assert main([str(tmp_path)]) == 2
    assert "has a run already" in capsys.readouterr().err


def test_what_is_no_journal_is_named(tmp_path, capsys):
    assert main([str(tmp_path)]) == 2
    assert "survey.journal cannot be read" in capsys.readouterr().err
    (tmp_path / "survey.journal").write_bytes(b"#ROSBAG V2.0 and so on")
    assert main([str(tmp_path)]) == 2
    assert "is no journal" in capsys.readouterr().err
