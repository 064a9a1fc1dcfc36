"""import_survey.py and degrade_odometry.py: from files to a bag, and what the bag holds."""

import re
import shlex
import subprocess
from pathlib import Path

import numpy as np
import pytest
import sonar_files
import yaml
from sonar_files import DEPTH_M, DOWN_M, SHARED, SPEED_MPS, START_S

rosbag = pytest.importorskip("rosbag", reason="rosbag is not installed")
pytest.importorskip("pyproj", reason="pyproj is not installed")

from sensor_msgs import point_cloud2  # noqa: E402

from rbpf_svgp_slam.checking.check_bag import main as check_bag  # noqa: E402
from rbpf_svgp_slam.importers.degraded_bag import main as degrade_bag  # noqa: E402
from rbpf_svgp_slam.importers.import_command import main  # noqa: E402
from rbpf_svgp_slam.nested import merged  # noqa: E402
from rbpf_svgp_slam.parameters.known import default_parameters  # noqa: E402
from rbpf_svgp_slam.parameters.loading import validate  # noqa: E402
from rbpf_svgp_slam.simulation.simulate_command import main as simulate  # noqa: E402

DOCUMENT = Path(__file__).parents[2] / "docs" / "your_survey.md"


@pytest.fixture
def made_up(tmp_path):
    """Files that need no optional package."""
    for kind, make in (
        ("kmall", sonar_files.kmall),
        ("all", sonar_files.all_),
        ("gsf", sonar_files.gsf),
    ):
        (tmp_path / f"s.{kind}").write_bytes(make(6.0))
    return tmp_path


def run(capfd, *arguments):
    status = main([str(argument) for argument in arguments])
    return (status, *capfd.readouterr())


def messages(path, topic):
    with rosbag.Bag(str(path)) as bag:
        return [message for _, message, _ in bag.read_messages(topics=[topic])]


def positions(path, topic="/odom"):
    """Stamps, s since START_S, and x, y, z [N, 4]."""
    return np.array(
        [
            (m.header.stamp.to_sec() - START_S, p.x, p.y, p.z)
            for m in messages(path, topic)
            for p in [m.pose.pose.position]
        ]
    )


@pytest.mark.parametrize("kind", ["kmall", "all", "gsf"])
def test_a_bag_has_what_the_package_takes(made_up, capfd, kind):
    out = made_up / "s.bag"
    origin = (sonar_files.LATITUDE_DEG, sonar_files.LONGITUDE_DEG)
    status, output, problems = run(
        capfd, made_up / f"s.{kind}", "--out", out, "--origin", *origin, "--rate", 20
    )
    assert (status, problems) == (0, "")
    assert "30 pings" in output or "31 pings" in output
    [fix] = messages(out, "/survey_origin")
    assert (fix.latitude, fix.longitude, fix.altitude, fix.header.frame_id) == (*origin, 0, "map")
    [mount] = messages(out, "/tf_static")
    # a GSF's positions and depths are the sonar's own
    down_m = 0.0 if kind == "gsf" else DOWN_M
    assert mount.transforms[0].transform.translation.z == pytest.approx(-down_m)
    odometry = messages(out, "/odom")
    # positions of a GSF come in 1.1 cm, five times a second
    assert odometry[3].twist.twist.linear.x == pytest.approx(SPEED_MPS, abs=0.06)
    assert odometry[3].pose.pose.orientation.z == pytest.approx(np.sqrt(0.5))  # north
    time_s, _, north_m, _ = positions(out).T
    # .all has positions in 6 mm, and comes in the millisecond
    np.testing.assert_allclose(north_m, SPEED_MPS * time_s, atol=0.02)
    cloud = messages(out, "/mbes/pings")[5]
    points_m = np.array(list(point_cloud2.read_points(cloud, ("x", "y", "z"))))
    np.testing.assert_allclose(points_m[:, 2], DOWN_M - DEPTH_M, atol=0.02)
    assert points_m[0, 1] > 30 and points_m[-1, 1] < -30  # port, which is left, first
    overlay = yaml.safe_load((made_up / "s.survey.yaml").read_text())
    assert overlay["survey_origin"] == list(origin)
    validate(merged(default_parameters(), overlay))
    assert check_bag([str(out), str(out.with_suffix(".survey.yaml")), "--quiet-if-good"]) == 0


def test_files_in_the_order_of_their_times_with_the_gap_between(tmp_path, capfd):
    pytest.importorskip("pyxtf", reason="pyxtf is not installed: tools/requirements.sh")
    for name, begin_s in (("a.xtf", 40.0), ("b.xtf", 0.0)):
        (tmp_path / name).write_bytes(sonar_files.xtf(10.0, begin_s))
    out = tmp_path / "s.bag"
    status, output, _ = run(capfd, tmp_path / "a.xtf", tmp_path / "b.xtf", "--out", out)
    assert status == 0 and output.index("b.xtf") < output.index("a.xtf")
    assert "a gap of 30.0 s after 10.0 s" in output
    time_s = positions(out)[:, 0]
    assert time_s[0] < 0.1 and time_s[-1] > 49.9
    assert not ((time_s > 10.1) & (time_s < 39.9)).any()
    # the same file again adds nothing
    again = tmp_path / "again.bag"
    files = [tmp_path / name for name in ("a.xtf", "b.xtf", "a.xtf")]
    status, output, _ = run(capfd, *files, "--out", again)
    assert status == 0 and "left out: 50 pings that came before already" in output
    np.testing.assert_array_equal(positions(out), positions(again))


def test_what_the_user_knows_better(made_up, capfd):
    out = made_up / "s.bag"
    profile = made_up / "profile.txt"
    profile.write_text("0 1500\n100 1500\n")
    options = ["--sonar", 0, 3, 5, "--mount-angles", 0, 0, 90, "--waterline", -1.5]
    options += ["--antenna", 0, 10, 0, "--profile", profile]
    status, output, _ = run(capfd, made_up / "s.kmall", "--out", out, *options)
    assert status == 0 and "a profile of 2 depths to 100 m" in output
    assert "contradicts" not in output
    profile.write_text("0 1490\n100 1500\n")
    _, output, _ = run(capfd, made_up / "s.kmall", "--out", made_up / "other.bag", *options)
    assert "uppermost speed, 1490.0 m/s, contradicts that" in output
    [mount] = messages(out, "/tf_static")
    translation = mount.transforms[0].transform.translation
    assert (translation.x, translation.y, translation.z) == (0, -3, -5)
    assert mount.transforms[0].transform.rotation.z == pytest.approx(-np.sqrt(0.5))
    first = positions(out)[0]
    assert first[3] == pytest.approx(-1.5)
    [fix] = messages(out, "/survey_origin")
    # the antenna is 10 m east of what is heading north
    east_m = 111_320 * np.cos(np.radians(60)) * (sonar_files.LONGITUDE_DEG - fix.longitude)
    assert first[1] == pytest.approx(east_m - 10, abs=0.1)


def test_a_file_that_is_cut_off_is_refused_or_kept_as_far_as_it_goes(made_up, capfd):
    path, out = made_up / "s.kmall", made_up / "s.bag"
    whole = path.read_bytes()
    path.write_bytes(whole[:-10])
    status, _, problems = run(capfd, path, "--out", out)
    assert status == 2 and not out.exists()
    last = whole.rindex(b"#MRZ") - 4
    left = rf"at byte {last}: {len(whole) - 10 - last} bytes of a #MRZ of {len(whole) - last}"
    assert re.search(rf"s\.kmall: {left}, expected all of it; --keep-cut-off", problems), problems
    status, output, _ = run(capfd, path, "--out", out, "--keep-cut-off")
    assert status == 0 and re.search(rf"CUT OFF +{left}; all before", output)
    assert len(messages(out, "/mbes/pings")) == 29


MISTAKES = {
    "out": (["--out", "s.txt"], "out is s.txt, expected a name that ends in .bag"),
    "folder": (["--out", "no/such/s.bag"], "expected a file in an existing folder"),
    "rate": (["--rate", "0"], "rate is 0.0, expected 1 to 1000 Hz"),
    "seed": (["--degrade-odometry", "-1"], "degrade_odometry is -1, expected a seed from 0"),
    "sonar": (["--sonar", "nan", "0", "0"], "sonar is .nan, .*expected finite numbers"),
    "arm": (["--sonar", "0", "1e4", "0"], "s.kmall: transmitter at .* 10000.0.* within 500 m"),
    "waterline": (
        ["--waterline", "1e9"],
        "s.kmall: waterline at .*expected finite numbers, within",
    ),
    "far": (
        ["--origin", "20", "60"],
        r"origin is \[20.0, 60.0\], 5.* km .* 60.0000, 20.0000, expect",
    ),
    "origin": (["--origin", "100", "0"], "origin is 100.0, 0.0, expected a latitude within ±90°"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_mistakes_in_the_arguments(made_up, capfd, name):
    options, expected = MISTAKES[name]
    default = [] if "--out" in options else ["--out", made_up / "s.bag"]
    status, _, problems = run(capfd, made_up / "s.kmall", *default, *options)
    assert status == 2 and re.search(expected, problems), problems


def test_soundings_are_not_computed_again(made_up, capfd):
    profile = made_up / "profile.txt"
    profile.write_text("0 1500\n100 1500\n")
    for options in (["--profile", profile], ["--mount-angles", 1, 0, 0]):
        arguments = [made_up / "s.gsf", "--out", made_up / "s.bag", *options]
        status, _, problems = run(capfd, *arguments)
        assert status == 2 and "s.gsf, whose soundings are computed already" in problems


def test_gsf_in_the_order_of_time_and_with_the_antenna_where_it_is(made_up, capfd):
    """Wherever the vehicle's reference point is, its beams stay where the file has them."""
    whole = (made_up / "s.gsf").read_bytes()
    ping_bytes = len(sonar_files.gsf_record(2, sonar_files.gsf_ping(0.0)))
    head, pings = whole[: -31 * ping_bytes], whole[-31 * ping_bytes :]
    (made_up / "a.gsf").write_bytes(head + pings[15 * ping_bytes :])
    (made_up / "b.gsf").write_bytes(head + pings[: 15 * ping_bytes])
    seabeds = []
    for options in ([], ["--antenna", 1, 2, 0]):
        out = made_up / "s.bag"
        files = [made_up / name for name in ("a.gsf", "b.gsf")]
        status, output, problems = run(capfd, *files, "--out", out, *options)
        assert (status, problems) == (0, "") and output.index("b.gsf") < output.index("a.gsf")
        assert "beams are the file's own soundings" in output
        cloud = messages(out, "/mbes/pings")[20]
        points_m = np.array(list(point_cloud2.read_points(cloud, ("x", "y", "z"))))
        place_m = positions(out)
        at = np.searchsorted(place_m[:, 0], cloud.header.stamp.to_sec() - START_S - 1e-6)
        # heading north: forward is y, port is -x
        x_m, y_m = place_m[at, 1] - points_m[:, 1], place_m[at, 2] + points_m[:, 0]
        seabeds.append(np.column_stack([x_m, y_m, place_m[at, 3] + points_m[:, 2]]))
    assert np.abs(place_m[at, 1] - x_m.mean()) > 1.9
    # the odometry comes every 2 cm
    np.testing.assert_allclose(*seabeds, atol=0.03)
    np.testing.assert_allclose(seabeds[0][:, 2], -DEPTH_M, atol=0.001)


def test_mistakes_in_files(made_up, capfd):
    out = ["--out", made_up / "s.bag"]
    status, _, problems = run(capfd, made_up / "none.xtf", *out)
    assert status == 2 and "none.xtf" in problems
    status, _, problems = run(capfd, made_up, *out)
    assert status == 2 and "a folder, expected a file of a sonar" in problems
    profile = made_up / "profile.txt"
    for text in (
        *("depth speed\n", "0 1500 3\n", "5 1500\n0 1500\n", ""),
        *("0 1500\n9 inf\n", "0 nan\n9 1500\n", "0 15.0\n9 15.1\n", "-9 1500\n0 1500\n"),
    ):
        profile.write_text(text)
        status, _, problems = run(capfd, made_up / "s.all", *out, "--profile", profile)
        assert status == 2 and "profile.txt" in problems and "two columns" in problems
    other = made_up / "other.kmall"
    other.write_bytes((made_up / "s.kmall").read_bytes().replace(b"Z=1.0;", b"Z=2.0;"))
    status, _, problems = run(capfd, made_up / "s.kmall", other, *out)
    assert status == 2 and "has another installation than" in problems
    assert "(transmitter Placed(" in problems and "waterline_m" not in problems
    other.write_bytes((made_up / "s.kmall").read_bytes().replace(b"Z=1.0;", b"Z=nan;"))
    status, _, problems = run(capfd, other, *out)
    assert status == 2 and "other.kmall: transmitter at (0.0, 0.0, nan" in problems
    itself = made_up / "kmall.bag"
    (made_up / "s.kmall").rename(itself)
    status, _, problems = run(capfd, itself, "--out", itself)
    assert status == 2 and "expected another file than those to be imported" in problems


def test_navigation_is_degraded_by_the_seed_and_kept_as_ground_truth(made_up, capfd):
    good, one, same, other = (made_up / f"{name}.bag" for name in ("good", "one", "same", "other"))
    path = made_up / "s.kmall"
    assert run(capfd, path, "--out", good)[0] == 0
    for out, seed in ((one, 1), (same, 1), (other, 2)):
        status, output, _ = run(capfd, path, "--out", out, "--degrade-odometry", seed)
        assert status == 0 and "odometry degraded: final error" in output
    np.testing.assert_array_equal(positions(one), positions(same))
    assert np.abs(positions(one) - positions(other)).max() > 0.01
    truth = positions(one, "/ground_truth")
    kept = np.searchsorted(positions(good)[:, 0], truth[:, 0])
    np.testing.assert_array_equal(truth, positions(good)[kept])
    drift_m = np.linalg.norm((positions(one) - positions(good))[:, 1:3], axis=1)
    # 0.08 m per sqrt(s) along and across, 6 s
    assert drift_m[0] == 0 and 0.01 < drift_m[-1] < 1.0
    overlay = yaml.safe_load((made_up / "one.survey.yaml").read_text())
    assert overlay["motion"]["surge_std_m"] == 0.08
    [ping] = [messages(bag, "/mbes/pings")[3] for bag in (one,)]
    assert ping.data == messages(good, "/mbes/pings")[3].data
    none = made_up / "none.bag"
    run(capfd, path, "--out", none, "--degrade-odometry", 1, "--drift", 0)
    # what is left is white noise of depth, roll and pitch
    assert np.linalg.norm((positions(none) - positions(good))[:, 1:3], axis=1).max() < 0.02


def test_any_bag_is_degraded(tmp_path, capfd):
    survey, out = tmp_path / "survey.bag", tmp_path / "new folder" / "degraded.bag"
    simulate(["--mission", "demo", "--seed", "3", "--duration", "60", "--out", str(survey)])
    capfd.readouterr()
    assert degrade_bag([str(survey), "--out", str(out), "--seed", "5"]) == 0
    assert "odometry degraded: final error" in capfd.readouterr().out
    before, truth, after = (
        positions(*of) for of in ((survey,), (out, "/ground_truth"), (out, "/odom"))
    )
    # resampled at the same even times
    np.testing.assert_allclose(truth[:, 1:], before[: len(truth), 1:], atol=1e-3)
    assert 0.05 < np.linalg.norm((after - truth)[-1, 1:3]) < 10
    assert len(messages(out, "/mbes/pings")) == len(messages(survey, "/mbes/pings"))
    assert len(messages(out, "/tf_static")) == 1 and not messages(out, "/tf")
    assert check_bag([str(out), "--quiet-if-good"]) == 0
    capfd.readouterr()
    for arguments, expected in (
        ([str(survey), "--out", str(survey), "--seed", "1"], "the bag itself"),
        ([str(survey), "--out", str(out), "--seed", "-1"], "seed is -1"),
        ([str(survey), "--out", str(out), "--seed", "1", "--odom", "/nav"], "no topic /nav"),
        ([str(survey), "--out", str(out), "--seed", "1", "--odom", "/tf"], "expected nav_msgs"),
        ([str(tmp_path / "no.bag"), "--out", str(out), "--seed", "1"], "no.bag"),
    ):
        assert degrade_bag(arguments) == 2
        assert expected in capfd.readouterr().err


def test_the_document_s_commands(tmp_path, capfd, monkeypatch):
    """Of the R2Sonic clip, as docs/your_survey.md has them."""
    clip = SHARED / "r2sonic2026.xtf"
    if not clip.exists():
        pytest.skip(f"no sonar file at {clip}")
    pytest.importorskip("pyxtf", reason="pyxtf is not installed: tools/requirements.sh")
    (tmp_path / "clip.xtf").symlink_to(clip)
    monkeypatch.chdir(tmp_path)
    programs = {
        "import_survey.py": main,
        "check_bag.py": check_bag,
        "degrade_odometry.py": degrade_bag,
    }
    words = [shlex.split(command) for command in re.findall(r"^rosrun .*$", section(), re.M)]
    assert {name for _, _, name, *_ in words} == set(programs)
    for _, _, name, *arguments in words:
        assert programs[name](arguments) == 0, name
    output = capfd.readouterr().out
    assert "beams agree within 0.094 m" in output and "beams agree within 0.019 m" in output
    [overlay] = re.findall(r"^```yaml\n(.*?)^```$", section(), re.MULTILINE | re.DOTALL)
    (tmp_path / "mapping.yaml").write_text(overlay)
    [command] = re.findall(r"^roslaunch .*$", section(), re.MULTILINE)
    # the bag is checked, and nothing is started: the mapping takes a minute
    command = command.replace("roslaunch ", "roslaunch --files ")
    subprocess.run(["bash", "-c", command], check=True, stdout=subprocess.DEVNULL)


def test_an_offline_replay_degrades_the_bag_before_it_begins():
    launch = (DOCUMENT.parents[1] / "launch" / "offline.launch").read_text()
    arguments = {"bag": "/a.bag", "out": "/b", "degrade_odometry": ""}
    [expression] = re.findall(r'name="replayed" value="\$\(eval (.*)\)"', launch)
    assert eval(expression, {}, arguments) == "/a.bag"
    assert eval(expression, {}, {**arguments, "degrade_odometry": 0}) == "/b.degraded.bag"
    assert launch.count("$(arg replayed)") == 3  # written, replayed, recorded
    assert launch.index("degrade_odometry.py") < launch.index("<node")


def section():
    """Of the document, on sonars' files."""
    text = DOCUMENT.read_text(encoding="utf-8").split("## A sonar's own files\n")[1]
    return text.split("\n## ")[0]
