"""The simulated survey's bag, its sidecar files and the command line."""

import numpy as np
import pytest


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A short survey written by the command line: the bag's path and its messages by topic."""
    rosbag = pytest.importorskip("rosbag", reason="rosbag is not installed")
    path = tmp_path_factory.mktemp("survey") / "short.bag"
    assert command("--mission", "demo", "--seed", "4", "--duration", "30", "--out", path) == 0
    topics = {}
    with rosbag.Bag(str(path)) as bag:
        latching = {c.topic: c.header.get("latching") for c in bag._get_connections()}
        for topic, message, time in bag.read_messages():
            topics.setdefault(topic, []).append((message, time))
    return path, topics, latching


def read_pings(path):
    """Stamps [P] and all pings' bytes as one float32 array."""
    rosbag = pytest.importorskip("rosbag")
    with rosbag.Bag(str(path)) as bag:
        pings = [ping for _, ping, _ in bag.read_messages(topics=["/mbes/pings"])]
    stamps = [ping.header.stamp.to_nsec() for ping in pings]
    return stamps, np.frombuffer(b"".join(ping.data for ping in pings), "<f4")


def command(*arguments):
    pytest.importorskip("rosbag", reason="rosbag is not installed")
    from rbpf_svgp_slam.simulation.simulate_command import main

    return main([str(argument) for argument in arguments])


def test_bag_topics_frames_and_stamps(recording):
    _, topics, latching = recording
    frames = {
        "/odom": ("odom", 600),
        "/tf": ("odom", 600),
        "/ground_truth": ("map", 300),
        "/mbes/pings": ("mbes", 90),
        "/tf_static": ("base_link", 1),
    }
    assert set(topics) == set(frames)
    for topic, (frame, count) in frames.items():
        assert len(topics[topic]) == pytest.approx(count, abs=2)
        stamps = []
        for message, time in topics[topic]:
            header = message.transforms[0].header if topic.startswith("/tf") else message.header
            assert header.frame_id == frame and header.stamp == time
            stamps.append(time.to_nsec())
        assert (np.diff(stamps) > 0).all()
    assert latching["/tf_static"] in ("1", b"1") and not latching["/odom"]
    pings = [message for message, _ in topics["/mbes/pings"]]
    assert [ping.header.seq for ping in pings] == list(range(1, len(pings) + 1))
    assert [field.name for field in pings[0].fields] == ["x", "y", "z"]
    assert all(len(ping.data) == ping.width * 12 and ping.height == 1 for ping in pings)


def test_bag_odometry_and_tf_carry_the_same_pose(recording):
    _, topics, _ = recording
    for (odometry, _), (tf, _) in zip(topics["/odom"], topics["/tf"]):
        transform, pose = tf.transforms[0], odometry.pose.pose
        assert transform.child_frame_id == odometry.child_frame_id == "base_link"
        assert transform.transform.translation.x == pose.position.x
        assert transform.transform.rotation.w == pose.orientation.w
    first, true = topics["/odom"][0][0], topics["/ground_truth"][0][0]
    assert first.pose.pose.position.x == true.pose.pose.position.x
    last = topics["/odom"][-1][0]
    variances = np.diag(np.reshape(last.pose.covariance, (6, 6)))
    assert variances[0] == pytest.approx(0.08**2 * 30, rel=0.01) and (variances > 0).all()


def test_sidecars_hold_the_area_and_the_terrain(recording):
    yaml = pytest.importorskip("yaml")
    path, topics, _ = recording
    overlay = yaml.safe_load(path.with_suffix(".survey.yaml").read_text())
    assert set(overlay) == {"survey_area", "motion"}
    assert np.shape(overlay["survey_area"]) == (4, 2)
    assert overlay["motion"] == {"surge_std_m": 0.08, "sway_std_m": 0.08, "yaw_std_rad": 0.0025}
    again = path.with_name("again.bag")
    terrain_path = path.with_suffix(".terrain.npz")
    arguments = ("--mission", "demo", "--seed", "4", "--duration", "30", "--terrain", terrain_path)
    assert command(*arguments, "--out", again) == 0
    (stamps, beams), (stamps_again, beams_again) = read_pings(path), read_pings(again)
    assert stamps == stamps_again, "the same seed and seabed give the same survey"
    # but for rounding: vectorised sums add in an order that depends on where an array lies
    np.testing.assert_allclose(beams, beams_again, rtol=0, atol=1e-4)


def test_command_line_mistakes_end_with_code_2_and_the_expectation(tmp_path, capfd):
    small, hole = tmp_path / "small.npz", tmp_path / "hole.npz"
    np.savez(small, z=np.full((50, 400), -40.0), resolution_m=1.0)
    holed_m = np.full((400, 400), -40.0)
    holed_m[130:150, 150:170] = np.nan
    np.savez(hole, z=holed_m, resolution_m=1.0)
    shallow = tmp_path / "shallow.npz"
    np.savez(shallow, z=np.full((400, 400), -9.0), resolution_m=1.0)
    (tmp_path / "text.npz").write_text("no archive")
    out = tmp_path / "f.bag"
    for arguments, message in [
        (("--mission", "lolo9"), "mission is 'lolo9', expected one of demo, lolo2"),
        (("--mission", "demo", "--terrain", tmp_path / "none.npz"), "no such file"),
        (("--mission", "demo", "--terrain", tmp_path / "text.npz"), "expected an npz file"),
        (("--mission", "demo", "--terrain", small), "demo needs x 0.0 .. 200.0 m"),
        (("--mission", "demo", "--terrain", hole), "terrain is NaN"),
        (("--mission", "demo", "--terrain", shallow), "expected below the surface"),
        (("--mission", "demo", "--outliers", "2"), "outliers is 2.0, expected"),
        (("--mission", "demo", "--duration", "nan"), "duration is nan s, expected"),
        (("--mission", "demo", "--seed", "-1"), "seed is -1, expected"),
        (("--mission", "demo", "--origin", "95", "11"), "--origin is [95.0, 11.0]; expected"),
        (("--mission", "demo", "--out", tmp_path / "f.txt"), "expected a name that ends in .bag"),
        (("--mission", "demo", "--out", tmp_path / "none/f.bag"), "in an existing folder"),
    ]:
        assert command("--out", out, *arguments) == 2
        assert message in capfd.readouterr().err
        assert not out.exists()
