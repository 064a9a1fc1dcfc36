"""check_bag.py on small bags, through the program that reads them as the nodes do."""

import re
import shlex
import subprocess
from pathlib import Path

import pytest
import yaml

rosbag = pytest.importorskip("rosbag", reason="rosbag is not installed")

from outsider_bag import ODOMETRY, PINGS, write_outsider_bag  # noqa: E402

from rbpf_svgp_slam.checking.check_bag import main  # noqa: E402
from rbpf_svgp_slam.nested import all_names, merged  # noqa: E402
from rbpf_svgp_slam.parameters.known import default_parameters  # noqa: E402
from rbpf_svgp_slam.parameters.loading import validate  # noqa: E402
from rbpf_svgp_slam.simulation.simulate_command import main as simulate  # noqa: E402

DOCUMENT = Path(__file__).parents[2] / "docs" / "your_survey.md"
TOPICS = ["--odom", ODOMETRY, "--pings", PINGS]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("a survey")  # with a blank


@pytest.fixture(scope="module")
def outsider(folder):
    write_outsider_bag(folder / "outsider.bag")
    return folder / "outsider.bag"


@pytest.fixture(scope="module")
def good(folder):
    path = folder / "good one.bag"
    arguments = ["--mission", "demo", "--seed", "4", "--duration", "60", "--out", str(path)]
    assert simulate(arguments) == 0
    return path


def run(capfd, *arguments):
    """Exit status, stdout and stderr of the command."""
    status = main([str(argument) for argument in arguments])
    return (status, *capfd.readouterr())


def bad(output):
    return re.findall(r"^(ERROR|warning) +(\S+)", output, re.MULTILINE)


def test_a_good_bag(good, capfd):
    status, output, problems = run(capfd, good)
    assert (status, problems) == (0, "")
    # a minute: no line is seen again
    assert bad(output) == [("warning", "overlap")]
    overlay = yaml.safe_load(good.with_suffix(".check.yaml").read_text())
    assert overlay["motion"] == {"surge_std_m": 0.08, "sway_std_m": 0.08, "yaw_std_rad": 0.0025}
    status, output, _ = run(capfd, good, good.with_suffix(".check.yaml"))
    assert status == 0 and "survey_area" in output and "ERROR" not in output


def test_an_outsider_s_bag_and_its_overlay(outsider, capfd):
    status, output, problems = run(capfd, outsider)
    assert (status, problems) == (0, "")
    assert bad(output) == [("warning", "twist")]
    for said in (
        f"{ODOMETRY} (nav_msgs/Odometry), 5000 messages",
        f"{PINGS} (sensor_msgs/PointCloud2)",
        "'map' → 'base_link': given in map",
        "turned by 180.0",
        "512 (median)",
        "outsider.bag: SLAM can run: 0 errors, 1 warning",
    ):
        assert said in output, said
    overlay = yaml.safe_load(outsider.with_suffix(".check.yaml").read_text())
    assert overlay["odometry"] == {"velocity": "pose"}
    # 0.06 m per sqrt(s), seen over 20 windows
    assert 0.03 < overlay["motion"]["surge_std_m"] < 0.09
    validate(merged(default_parameters(), overlay))
    command = shlex.split(output.splitlines()[-1])
    assert command[:3] == ["roslaunch", "rbpf_svgp_slam", "offline.launch"]
    assert f"odom_topic:={ODOMETRY}" in command and f"ping_topic:={PINGS}" in command
    status, output, _ = run(capfd, outsider, outsider.with_suffix(".check.yaml"))
    assert (status, bad(output)) == (0, [])


def test_a_config_that_does_not_suit_the_bag(outsider, capfd, tmp_path):
    config = tmp_path / "wrong.yaml"
    config.write_text(
        "survey_area: [[500000, 6400000], [500100, 6400000], [500100, 6400100]]\n"
        "frames: {map: world}\nodometry: {velocity: twist}\n"
    )
    status, output, _ = run(capfd, outsider, config, "--out", tmp_path / "o.yaml")
    assert status == 1
    assert [name for severity, name in bad(output) if severity == "ERROR"] == [
        "odometry_frames",
        "area_missed",
        "twist",
    ]
    assert "UTM" in output and (tmp_path / "o.yaml").is_file()
    for text, said in (
        ("particels: 3\n", "did you mean particles"),
        ("motion: {surge_std_m: -1.0}\n", "motion/surge_std_m"),  # which only the core reads
        ("survey_area: [[0, 0]]\n", "expected a polygon"),
        ("survey_area: [\n", "while parsing"),
        ("motion: {surge_std_m: }\n", "no value that can be sent"),
        ("motion: 3\n", "motion/surge_std_m"),
        ("frames: {odom: 3}\n", "frames/odom"),
    ):
        config.write_text(text)
        status, output, _ = run(capfd, outsider, config, "--out", tmp_path / "o.yaml")
        found = dict(reversed(pair) for pair in bad(output))
        assert (status, found["config"]) == (1, "ERROR"), output
        assert said in " ".join(output.split())


def test_bags_that_cannot_be_used(folder, outsider, capfd):
    no_pings, no_mount, cut = (folder / f"{name}.bag" for name in ("no_pings", "no_mount", "cut"))
    write_outsider_bag(no_pings, duration_s=2.0, pings=False)
    write_outsider_bag(no_mount, duration_s=2.0, mount=False, beams=16)
    cut.write_bytes(outsider.read_bytes()[:-100_000])
    for bag, name, said in (
        (no_pings, "pings_topic", f"the bag's topics are {ODOMETRY}"),
        (no_mount, "mount", "'base_link' to 'norbit'"),
        (cut, "bag", "rosbag reindex"),
    ):
        status, output, _ = run(capfd, bag)
        assert status == 1
        errors = [found for severity, found in bad(output) if severity == "ERROR"]
        assert errors == [name] and said in " ".join(output.split())
    assert not no_pings.with_suffix(".check.yaml").exists()
    status, _, problems = run(capfd, folder / "none.bag")
    assert status == 2 and "no such file" in problems


def test_an_overlay_that_cannot_be_written(good, capfd, tmp_path):
    status, output, problems = run(capfd, good, "--out", tmp_path / "none" / "o.yaml")
    assert status == 0 and "give --out" in problems


def test_topics_that_are_not_in_the_bag(outsider, capfd):
    status, output, _ = run(capfd, outsider, "--odom", "/odom", "--pings", "/mbes/pings")
    assert status == 1
    assert [name for _, name in bad(output)] == ["odometry_topic", "pings_topic"]
    assert f"{ODOMETRY} could be meant" in output


# Launch files


def launch(*arguments):
    """Of a launch: exit status, stdout, stderr."""
    command = ["roslaunch", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize("file", ["offline.launch", "replay.launch"])
def test_launch_files_check_first_and_stop(outsider, file):
    arguments = ["rbpf_svgp_slam", file, f"bag:={outsider}", "out:=/nowhere"]
    topics = [f"odom_topic:={ODOMETRY}", f"ping_topic:={PINGS}"]
    status, _, problems = launch(*arguments, *topics)
    assert status == 1 and re.search(r"^ERROR +survey_area +not set$", problems, re.MULTILINE)
    assert "check_bag.py '" in problems and "check:=false" in problems
    assert "process[" not in problems  # nothing has been started
    assert launch("--dump-params", *arguments, *topics, "check:=false")[0] == 0


def test_launch_files_go_on_with_the_overlay(outsider, capfd):
    run(capfd, outsider)
    command = shlex.split(run(capfd, outsider)[1].splitlines()[-1])
    status, parameters, problems = launch("--dump-params", *command[1:])
    assert status == 0 and "ERROR" not in problems
    assert "0 errors" in yaml.safe_load(parameters)["/rbpf_core/bag_check"]


# The document, whose commands test_surveys.py and test_import_survey.py run


def test_a_mount_is_added_as_the_document_says(tmp_path, capfd, monkeypatch):
    write_outsider_bag(tmp_path / "survey.bag", duration_s=2.0, beams=16, mount=False)
    monkeypatch.chdir(tmp_path)
    [program] = re.findall(
        r"^```python\n(.*?)^```$", DOCUMENT.read_text(), re.MULTILINE | re.DOTALL
    )
    exec(compile(program, str(DOCUMENT), "exec"), {})
    status, output, _ = run(capfd, "with_mount.bag")
    assert status == 0 and "'norbit' at x 0.30, y 0.00, z -0.60 m" in output


def test_every_parameter_of_the_tuning_page_is_there():
    text = (DOCUMENT.parent / "tuning.md").read_text()
    known = set(all_names(default_parameters()))
    groups = {name for name in default_parameters() if "/" not in name}
    named = {word.split(":")[0] for word in re.findall(r"`([a-z0-9_/]+)[:`]", text) if "/" in word}
    named = {word for word in named if word.split("/")[0] in groups}
    assert len(named) > 30
    assert named - known - {"motion/"} == set()
