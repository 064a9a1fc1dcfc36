"""Tracks: interpolated to the pings' stamps, written and read as TUM files."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rbpf_svgp_slam.run.tracks import interpolate_poses, read_tum, write_tum


def test_interpolation_is_linear_and_takes_yaw_the_short_way_round():
    poses = np.array([[0, 0, -5, 0, 0, np.pi - 0.1], [2, 4, -7, 0, 0, -np.pi + 0.3]])
    result = interpolate_poses([10.0, 12.0], poses, [9.99, 10.0, 11.0, 12.0, 12.01])
    assert np.isnan(result[[0, 4]]).all()
    np.testing.assert_allclose(result[2, :3], [1, 2, -6])
    np.testing.assert_allclose(result[1:4, 5], [np.pi - 0.1, -np.pi + 0.1, -np.pi + 0.3])


def test_interpolation_sorts_messages_and_respects_gaps():
    poses = np.zeros((4, 6))
    poses[:, 0] = [5.0, 0.0, 1.0, 9.0]
    stamp_s = [5.0, 0.0, 1.0, 1.0]
    x = interpolate_poses(stamp_s, poses, [0.5, 1.0, 3.0, 5.0], max_gap_s=2.0)[:, 0]
    np.testing.assert_allclose(x, [0.5, 1.0, np.nan, 5.0])
    assert np.isnan(interpolate_poses([1.0], poses[:1], [1.0])).all()
    with pytest.raises(ValueError, match="finite"):
        interpolate_poses([0.0, 1.0], np.full((2, 6), np.nan), [0.5])


@settings(max_examples=30, deadline=None)
@given(
    angles=st.tuples(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1)),
    position=st.tuples(*[st.floats(-1e4, 1e4)] * 3),
)
def test_tum_round_trip(tmp_path_factory, angles, position):
    path = tmp_path_factory.mktemp("tum") / "track.tum"
    poses = np.array([[*position, *angles], np.full(6, np.nan)])
    write_tum(path, np.array([1.6e9 + 0.25, 1.6e9 + 1]), poses)
    stamp_s, read = read_tum(path)
    assert stamp_s == [1.6e9 + 0.25]
    # Nine decimals of metres; a quaternion's nine decimals near pitch = ±1.5 rad, where roll and
    # yaw are cos(1.5) = 0.07 apart from degenerate.
    np.testing.assert_allclose(read[0, :3], position, atol=1e-9, rtol=0)
    np.testing.assert_allclose(read[0, 3:], angles, atol=1e-7, rtol=0)


def test_tum_without_poses_is_empty(tmp_path):
    write_tum(tmp_path / "empty.tum", np.empty(0), np.empty((0, 6)))
    stamp_s, poses = read_tum(tmp_path / "empty.tum")
    assert stamp_s.shape == (0,) and poses.shape == (0, 6)


@pytest.mark.parametrize(
    "line, message",
    [
        ("1 2 3", "expected 8 numbers .*, got 3"),
        ("2 0 0 0 0 0 0 one", "expected 8 numbers, got"),
        ("2 nan 0 0 0 0 0 1", "expected finite numbers"),
        ("2 0 0 0 0 0 0 2", "expected a unit quaternion, got one of norm 2"),
        ("0.5 0 0 0 0 0 0 1", "expected increasing stamps, got 0.5"),
    ],
)
def test_malformed_tum_line_is_named(tmp_path, line, message):
    path = tmp_path / "bad.tum"
    path.write_text(f"# a comment\n1 0 0 0 0 0 0 1\n\n{line}\n")
    with pytest.raises(ValueError, match=f"bad.tum:4: {message}"):
        read_tum(path)
