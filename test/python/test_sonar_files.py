"""Files of sonars, made up and real: what is read of them, and what is refused, and where."""

import struct
import sys
from pathlib import Path

import numpy as np
import pytest
import sonar_files
from sonar_files import DEPTH_M, DOWN_M, SHARED, SPEED_MPS

from rbpf_svgp_slam.importers.beam_geometry import in_map, laid_out
from rbpf_svgp_slam.importers.formats import read_sonar_file
from rbpf_svgp_slam.importers.local_frame import LocalFrame
from rbpf_svgp_slam.importers.sonar_file import ImportProblem, SonarFileError
from rbpf_svgp_slam.importers.sonar_survey import make_survey
from rbpf_svgp_slam.importers.vehicle_track import make_tracks

pytest.importorskip("pyproj", reason="pyproj is not installed")
GSF = Path(__file__).parent / "data" / "plane.gsf"
MADE_UP = {
    "xtf": sonar_files.xtf,
    "kmall": sonar_files.kmall,
    "all": sonar_files.all_,
    "gsf": sonar_files.gsf,
}


def need(kind):
    if kind == "xtf":
        pytest.importorskip("pyxtf", reason="pyxtf is not installed: tools/requirements.sh")


def real(name):
    path = SHARED / name
    if not path.exists():
        pytest.skip(f"no sonar file at {path}")
    need(path.suffix[1:])
    return read_sonar_file(path)


@pytest.fixture
def write(tmp_path):
    def written(data, name="survey"):
        path = tmp_path / name
        path.write_bytes(data)
        return path

    return written


def track_of(recording, rate_hz=50.0):
    positions = recording.positions
    frame = LocalFrame(positions.latitude_deg[0], positions.longitude_deg[0])
    return make_tracks(recording, frame, rate_hz)[0]


def placed(recording, track):
    """Swaths within the track, and their beams in map."""
    for swath in recording.swaths:
        if track.time_s[0] <= swath.time_s and swath.time_s + 0.1 <= track.time_s[-1]:
            if recording.computed:
                yield swath, laid_out(swath, track, recording.installation.positioning)
                continue
            points_m = in_map(
                swath,
                track,
                recording.installation,
                recording.profile,
                recording.speed_of_profile,
            )
            yield swath, points_m


@pytest.mark.parametrize("kind", MADE_UP)
def test_a_flat_seabed_under_a_straight_line(write, kind):
    need(kind)
    recording = read_sonar_file(write(MADE_UP[kind]()))
    track = track_of(recording)
    # the names of the fields' resolutions: .all has its angles in 0.01 degree and positions in 6 mm
    atol = 0.02
    np.testing.assert_allclose(track.linear_mps.mean(axis=0), (SPEED_MPS, 0, 0), atol=atol)
    pings = list(placed(recording, track))
    assert len(pings) >= 15
    for swath, points_m in pings:
        np.testing.assert_allclose(points_m[:, 2], -DEPTH_M, atol=atol)
        # it goes north: starboard is east
        reach_m = (DEPTH_M - sonar_files.DOWN_M) * np.tan(sonar_files.ANGLES_RAD)
        np.testing.assert_allclose(points_m[:, 0], reach_m, atol=2 * atol)
        north_m = SPEED_MPS * (swath.time_s - recording.positions.time_s[0])
        np.testing.assert_allclose(points_m[:, 1], north_m, atol=5 * atol)  # of the motion, too


def test_mount_angles_of_the_file_are_taken_out(write):
    need("xtf")
    recording = read_sonar_file(write(sonar_files.xtf(roll_deg=4.0)))
    for _, points_m in placed(recording, track_of(recording)):
        np.testing.assert_allclose(points_m[:, 2], -DEPTH_M, atol=0.02)


@pytest.mark.parametrize("kind", MADE_UP)
def test_of_a_file_that_is_cut_off_all_before_is_kept(write, kind):
    need(kind)
    data = MADE_UP[kind]()
    whole = read_sonar_file(write(data))
    cut = read_sonar_file(write(data[:-50]))
    assert (whole.cut_off, len(cut.swaths)) == ("", len(whole.swaths) - (kind != "xtf"))
    assert cut.cut_off.startswith("at byte ")
    offset = int(cut.cut_off.split()[2].rstrip(":"))
    assert len(data) - 5000 < offset < len(data) - 50
    assert len(read_sonar_file(write(data[: offset + 3])).swaths) == len(cut.swaths)


@pytest.mark.parametrize("kind", MADE_UP)
def test_a_damaged_record_is_refused_by_its_offset(write, kind):
    need(kind)
    data = bytearray(MADE_UP[kind]())
    offset = {"xtf": 1024 + 64, "kmall": struct.unpack_from("<I", data)[0]}.get(kind, 0)
    if kind == "gsf":
        offset = 8 + struct.unpack_from(">I", data)[0]
    if kind == "all":
        offset = 4 + struct.unpack_from("<I", data)[0]
    data[offset : offset + 6] = b"\xff" * 6
    with pytest.raises(SonarFileError, match=rf"survey: at byte {offset}: .*, expected "):
        read_sonar_file(write(bytes(data)))


FOREIGN = {
    "empty": (b"", "at byte 0: an empty file"),
    "png": (b"\x89PNG\r\n\x1a\n" + bytes(100), "at byte 0: .*PNG.*expected XTF"),
    "short": (b"{", "at byte 0: 1 bytes left, expected 1024 bytes of file header"),
    "zeros": (bytes(4000), "at byte 0"),
    "xtf without pings": (sonar_files.xtf_header(), "the file's end without a ping"),
    "kmall without pings": (
        sonar_files.kmall_datagram(b"#SVP", 0.0, sonar_files.kmall_profile()),
        "the file's end without a ping",
    ),
    "projected": (
        sonar_files.xtf_header()[:164] + b"\0\0" + sonar_files.xtf_header()[166:],
        "at byte 164: NavUnits 0",
    ),
    "two receivers": (
        sonar_files.kmall_datagram(b"#MRZ", 0.0, sonar_files.kmall_ping(0.0, receivers=2)),
        "receiver 0 of 2, expected a sonar with one",
    ),
    "sector": (
        sonar_files.kmall_datagram(b"#MRZ", 0.0, sonar_files.kmall_ping(0.0, sector=3)),
        "a beam of sector 3",
    ),
    "sector of .all": (
        sonar_files.all_datagram(b"N", 0.0, sonar_files.all_ping(sector=7)),
        "a beam of sector 7",
    ),
}


@pytest.mark.parametrize("name", FOREIGN)
def test_what_is_no_file_of_a_sonar_is_refused(write, name):
    if name in ("short", "projected") or name.startswith("xtf"):
        need("xtf")
    data, expected = FOREIGN[name]
    with pytest.raises(ImportProblem, match=expected):
        read_sonar_file(write(data))


def test_a_folder_is_refused(tmp_path):
    with pytest.raises(ImportProblem, match="a folder, expected a file"):
        read_sonar_file(tmp_path)


BROKEN_PACKETS = {
    "a section beyond the packet": (b"R0\x00", b"R0\xff", "section b'R0' of 65"),
    "no angles": (b"A2\x00", b"A9\x00", "expected angles, A0 or A2"),
    "no ranges": (b"R0\x00", b"R9\x00", "expected b'R0' among them"),
    "another packet": (b"BTH0", b"SNI0", "b'SNI0', expected b'BTH0'"),
}


@pytest.mark.parametrize("name", BROKEN_PACKETS)
def test_a_broken_r2sonic_packet_is_refused(write, name):
    need("xtf")
    old, new, expected = BROKEN_PACKETS[name]
    data = sonar_files.xtf_header() + sonar_files.xtf_ping(0.0)
    with pytest.raises(ImportProblem, match=expected):
        read_sonar_file(write(data.replace(old, new)))


def test_a_packet_of_no_length_does_not_go_on_for_ever(write):
    need("xtf")
    data = bytearray(sonar_files.xtf(1.0))
    struct.pack_into("<I", data, 1024 + 10, 0)
    with pytest.raises(ImportProblem, match="at byte 1034: a packet of 0 bytes"):
        read_sonar_file(write(bytes(data)))


def test_an_optional_package_that_is_missing_is_named(write, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyxtf", None)
    with pytest.raises(ImportProblem, match="pyxtf, .* tools/requirements.sh installs it"):
        read_sonar_file(write(sonar_files.xtf(1.0)))
    monkeypatch.setitem(sys.modules, "pyproj", None)
    with pytest.raises(ImportProblem, match="apt-get install python3-pyproj"):
        LocalFrame(0.0, 0.0)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # numpy's, of numbers that are none
@pytest.mark.parametrize("kind", MADE_UP)
def test_whatever_is_wrong_with_a_file_is_told(write, kind):
    """Bytes are overwritten at random: the file is imported, or refused by its name."""
    need(kind)
    rng = np.random.default_rng(1)
    whole = MADE_UP[kind](1.0)
    refused = 0
    for number in range(200):
        data = np.frombuffer(whole, np.uint8).copy()
        first = rng.integers(len(data) - 4)
        # lengths and counts lie in headers, which are early as often as not
        first = first if number % 2 else first % 1500
        data[first : first + 4] = rng.choice([0, 255, rng.integers(256)], 4)
        try:
            recording = read_sonar_file(write(data.tobytes(), str(number)))
            make_survey([recording], (60.0, 20.0), 20.0)
        except ImportProblem as error:
            assert str(number) in str(error)
            refused += 1
    assert refused > 5


@pytest.mark.parametrize("kind", ["kmall", "all"])
def test_a_vehicle_that_dives(write, kind):
    if kind == "kmall":
        depths = [
            sonar_files.kmall_datagram(
                b"#SDE", t, struct.pack("<4H5f", 8, 0, 0, 0, 50 + t, *[0] * 4)
            )
            for t in (0.0, 4.0)
        ]
    else:
        depths = [
            sonar_files.all_datagram(
                b"X", t, struct.pack("<2Hf2Hf4x", 0, 15000, DOWN_M + 50 + t, 0, 0, 0.0)
            )
            for t in (0.0, 4.0)
        ]
    recording = read_sonar_file(write(MADE_UP[kind]() + b"".join(depths)))
    track = track_of(recording)
    elapsed_s = track.time_s - recording.positions.time_s[0]
    np.testing.assert_allclose(track.position_m[:, 2], -50 - elapsed_s, atol=0.01)


GSF_MISTAKES = {
    "scale": (b"\x64\x00\x00\x1c", b"\x65\x00\x00\x1c", "part 1 without a scale"),
    "compressed": (b"\1\x40\0\0", b"\1\x41\0\0", "part 1 compressed"),
    "size": (b"\1\0\0\x7c", b"\1\0\0\x7b", "123 bytes of part 1, expected 1, 2 or 4 for 31 beams"),
    "beyond": (b"\2\0\0\x7c", b"\2\0\1\x7c", "380 bytes of part 2, expected 124 or less"),
}


@pytest.mark.parametrize("name", GSF_MISTAKES)
def test_a_broken_ping_of_gsf_is_refused(write, name):
    old, new, expected = GSF_MISTAKES[name]
    data = sonar_files.gsf(1.0)
    assert old in data
    with pytest.raises(SonarFileError, match=rf"survey: at byte \d+: {expected}"):
        read_sonar_file(write(data.replace(old, new)))


def test_gsf_before_version_3_has_shorter_pings(write):
    old, new = (read_sonar_file(write(sonar_files.gsf(1.0, version))) for version in (2, 3))
    assert [swath.time_s for swath in old.swaths] == [swath.time_s for swath in new.swaths]
    for one, other in zip(old.swaths, new.swaths):
        np.testing.assert_array_equal(one.place_m, other.place_m)


def test_what_a_ping_of_gsf_does_not_know(write):
    """Roll, pitch and heave are 0 then; without a depth corrector the vehicle is at the surface."""
    data = sonar_files.gsf(1.0)
    known = struct.pack(">hiH3h", 0, round(100 * DOWN_M), 0, 0, 0, 0)
    unknown = struct.pack(">hiH3h", 9999, 9999, 0, 9900, 9900, 9900)
    without_records = data[:20] + data[20 + 8 + struct.unpack_from(">I", data, 20)[0] :]
    recording = read_sonar_file(write(without_records.replace(known, unknown)))
    assert recording.depths is None and len(recording.attitudes.time_s) == len(recording.swaths)
    for name in ("roll_rad", "pitch_rad", "heave_m"):
        assert not getattr(recording.attitudes, name).any()
    assert any("no attitude records" in line for line in recording.found)


def test_a_checksum_of_gsf_that_does_not_fit_is_refused(write):
    data = GSF.read_bytes()
    # the first record after the version, which has a checksum
    assert struct.unpack_from(">I", data, 24)[0] == 0x8000_0002
    changed = data[:40] + bytes([data[40] ^ 1]) + data[41:]
    with pytest.raises(SonarFileError, match="at byte 20: bytes that sum to .*, the checksum"):
        read_sonar_file(write(changed))


def test_soundings_of_libgsf_lie_on_their_plane():
    """Of a file that libgsf 3.09 has written, by plane_gsf.py, which says what it holds."""
    recording = read_sonar_file(GSF)
    assert (len(recording.swaths), recording.cut_off) == (19, "")  # one ping of 20 is rejected
    assert {len(swath.place_m) for swath in recording.swaths} == {6}  # one beam of 7
    assert "left out: 1 pings, and 19 beams of the others" in "".join(recording.found)
    attitudes = recording.attitudes
    np.testing.assert_allclose(np.degrees(attitudes.roll_rad[:3]), (0.0, 0.1, 0.2), atol=1e-9)
    np.testing.assert_allclose(np.degrees(attitudes.pitch_rad), -1.5)
    np.testing.assert_allclose(np.degrees(attitudes.heading_rad), 30.0)
    # of the file's draught and tide
    np.testing.assert_allclose(recording.depths.depth_m, 1.25 - 0.5)
    track = track_of(recording)
    pings = list(placed(recording, track))
    assert len(pings) >= 17
    for swath, points_m in pings:
        x_m, y_m, z_m = points_m.T
        # depths in cm, positions in 1e-7 degree (1.1 cm) on a slope of 0.1
        np.testing.assert_allclose(z_m, -(20 + 0.1 * x_m - 0.05 * y_m), atol=0.01)
        along_m = 2.0 * (swath.time_s - recording.start_s)
        foot_m = points_m.mean(axis=0)[:2] - (sum_of_beams_m() / 6)
        towards = np.array([np.sin(np.radians(30)), np.cos(np.radians(30))])
        np.testing.assert_allclose(foot_m, along_m * towards, atol=0.03)


def sum_of_beams_m():
    """East and north of the six good beams, from the sonar."""
    across_m = np.array([-30.0, -20.0, -10.0, 10.0, 20.0, 30.0]).sum()
    along_m = np.array([-0.3, -0.2, -0.1, 0.1, 0.2, 0.6]).sum()
    s, c = np.sin(np.radians(30)), np.cos(np.radians(30))
    return np.array([across_m * c + along_m * s, along_m * c - across_m * s])


# Real files


def errors_m(recording, rate_hz=100.0):
    """Ours less the maker's solution [N, 3], x forward, y starboard, z down; and theirs."""
    track = track_of(recording, rate_hz)
    found, maker = [], []
    for swath, points_m in placed(recording, track):
        position_m, rpy_rad = track.poses_at(np.array([swath.time_s]))
        x, y = (points_m[:, :2] - position_m[0, :2]).T
        c, s = np.cos(rpy_rad[0, 2]), np.sin(rpy_rad[0, 2])
        found.append(np.column_stack([c * x + s * y, s * x - c * y, -points_m[:, 2]]))
        maker.append(swath.maker_m)
    found, maker = np.concatenate(found), np.concatenate(maker)
    known = np.isfinite(found).all(axis=1)
    return (found - maker)[known], maker[known]


def test_kmall_gives_the_maker_s_own_beams():
    recording = real("em2040.kmall")
    assert (recording.sonar, len(recording.swaths)) == ("Kongsberg EM2040P", 25)
    assert recording.installation.waterline_m == pytest.approx(0.33)
    error_m, _ = errors_m(recording)
    assert len(error_m) > 9000
    # their ray tracing and ours, in 3 m of water; attitude between samples 10 ms apart
    assert np.abs(error_m).max() < 0.005
    assert np.sqrt(np.mean(error_m**2)) < 0.001


def test_all_gives_the_maker_s_own_depths():
    recording = real("em710.all")
    assert (recording.sonar, len(recording.swaths)) == ("Kongsberg EM710", 158)
    error_m, maker_m = errors_m(recording)
    assert len(error_m) > 40_000
    rms_m = np.sqrt(np.mean(error_m**2, axis=0))
    # angles in 0.01°, attitude in 0.01°, heave in cm
    assert rms_m[0] < 0.03 and rms_m[2] < 0.04
    # The file has 1500.0 m/s for the array, 1528.8 m/s in its profile; SIS has used the one for
    # distances across, the other for depths. 1.9 % of the distance from the receiver, then:
    across_m = maker_m[:, 1] - recording.installation.receiver.starboard_m
    stretched_m = error_m[:, 1] - across_m * (1528.8 / 1500.0 - 1)
    assert np.sqrt(np.mean(stretched_m**2)) < 0.04


def test_the_r2sonic_clip():
    recording = real("r2sonic2026.xtf")
    assert (recording.sonar, len(recording.swaths)) == ("R2Sonic 2026", 923)
    assert {len(swath.angle_rad) for swath in recording.swaths} == {256}
    assert (len(recording.positions.time_s), len(recording.attitudes.time_s)) == (1204, 1203)
    heading_deg = np.degrees(np.unwrap(recording.attitudes.heading_rad))
    assert 240 < heading_deg.min() < 252 and 270 < heading_deg.max() < 278
    for swath in recording.swaths[::100]:
        range_m = 0.5 * swath.surface_speed_mps * swath.travel_time_s
        across_m, down_m = range_m * np.sin(swath.angle_rad), range_m * np.cos(swath.angle_rad)
        assert -23 < across_m.min() and across_m.max() < 20
        assert 8.5 < down_m.min() and down_m.max() < 12.5


def test_roll_makes_the_clip_s_seabed_flat():
    recording = real("r2sonic2026.xtf")

    def spread_m(sign):
        attitudes = recording.attitudes
        turned = type(attitudes)(**{**vars(attitudes), "roll_rad": sign * attitudes.roll_rad})
        other = type(recording)(**{**vars(recording), "attitudes": turned})
        pings = [points_m[:, 2] for _, points_m in placed(other, track_of(other, 25.0))]
        return np.median(np.std(pings, axis=0))

    # beam by beam over time: 0.15 m against 0.62 m, as whoever levelled it by hand has found
    assert spread_m(+1) < 0.2 and spread_m(-1) > 0.5
