"""Facts about a bag that nobody has recorded: a survey in which nothing is wrong."""

import numpy as np

from rbpf_svgp_slam.checking.facts import ChosenTopics, Facts, Mount, Topic
from rbpf_svgp_slam.parameters.known import default_parameters

START_S = 1_700_000_000.0
SPEED_MPS = 2.0
LINES, LENGTH_M, APART_M = 5, 100.0, 15.0
ODOMETRY_HZ, PING_HZ, BEAMS = 20.0, 2.0, 21
DEPTH_M, VEHICLE_Z_M, HALF_SWATH_M = 30.0, -10.0, 20.0
AREA = [[-30.0, -30.0], [130.0, -30.0], [130.0, 90.0], [-30.0, 90.0]]
#: Of the twist, per sqrt(s).
SURGE_STD_M, SWAY_STD_M, YAW_STD_RAD = 0.06, 0.03, 0.002


def topic(name, type_name, child_frame="", frame="odom", messages=4000):
    return Topic(
        name,
        type_name,
        messages,
        START_S,
        START_S + 280.0,
        is_odometry=type_name == "nav_msgs/Odometry",
        is_pings=type_name in ("sensor_msgs/PointCloud2", "sensor_msgs/LaserScan"),
        frame=frame,
        child_frame=child_frame,
    )


ODOMETRY = topic("/odom", "nav_msgs/Odometry", "base_link")
PINGS = topic("/mbes/pings", "sensor_msgs/PointCloud2", frame="mbes", messages=560)
TRUTH = topic("/ground_truth", "nav_msgs/Odometry", "base_link", "map")


def track(time_s):
    """x, y, yaw at times: lines along x, to and fro, a step aside after each."""
    corners = [
        (x, APART_M * k)
        for k in range(LINES)
        for x in ((0.0, LENGTH_M) if k % 2 == 0 else (LENGTH_M, 0.0))
    ]
    way_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    x, y = (np.interp(SPEED_MPS * time_s, way_m, column) for column in zip(*corners))
    ahead = [np.interp(SPEED_MPS * time_s + 0.1, way_m, column) for column in zip(*corners)]
    return x, y, np.arctan2(ahead[1] - y, ahead[0] - x)


def make_facts(tree=None):
    """Facts as rbpf_inspect_bag finds them, with the default parameters."""
    duration_s = (LINES * LENGTH_M + (LINES - 1) * APART_M) / SPEED_MPS - 1.0
    odometry = _odometry(np.arange(0.0, duration_s, 1 / ODOMETRY_HZ))
    placed, beams = _placed(np.arange(1.0, duration_s - 1.0, 1 / PING_HZ))
    n = len(placed["stamp_s"])
    range_m = np.hypot(DEPTH_M + VEHICLE_Z_M, HALF_SWATH_M)
    pings = {
        "record_s": placed["stamp_s"],
        "stamp_s": placed["stamp_s"],
        "frame": np.zeros(n),
        "beams": np.full(n, float(BEAMS)),
        "finite": np.full(n, float(BEAMS)),
        "within": np.full(n, float(BEAMS)),
        "min_range_m": np.full(n, DEPTH_M + VEHICLE_Z_M),
        "median_range_m": np.full(n, 1.1 * (DEPTH_M + VEHICLE_Z_M)),
        "max_range_m": np.full(n, range_m),
    }
    names = "record_s stamp_s x_m y_m z_m roll_rad pitch_rad yaw_rad".split()
    return Facts(
        topics=[ODOMETRY, PINGS],
        chosen=ChosenTopics(ODOMETRY, PINGS),
        parameters=tree or default_parameters(),
        odometry=odometry,
        pings=pings,
        placed=placed,
        beams=beams,
        ground_truth={name: np.zeros(0) for name in names},
        mounts=[Mount("mbes", (0.5, 0.0, -0.1), (np.pi, 0.0, 0.0))],
        links=[("base_link", "mbes")],
    )


def _odometry(time_s):
    x, y, yaw = track(time_s)
    zeros = np.zeros(len(time_s))
    names = "record_s stamp_s x_m y_m z_m roll_rad pitch_rad yaw_rad".split()
    columns = [START_S + time_s, START_S + time_s, x, y, zeros + VEHICLE_Z_M, zeros, zeros, yaw]
    table = dict(zip(names, columns))
    table |= {name: zeros.copy() for name in "v_mps w_mps p_radps q_radps r_radps".split()}
    table["u_mps"] = zeros + SPEED_MPS
    for name, std in (("var_u", SURGE_STD_M), ("var_v", SWAY_STD_M), ("var_r", YAW_STD_RAD)):
        table[name] = zeros + std**2 * ODOMETRY_HZ
    return table


def _placed(time_s):
    """The table of pings placed, and that of their beams: a fan over a flat seabed."""
    x, y, yaw = track(time_s)
    n = len(time_s)
    left = np.linspace(-HALF_SWATH_M, HALF_SWATH_M, BEAMS)
    placed = {
        "stamp_s": START_S + time_s,
        "good": np.full(n, float(BEAMS)),
        "vehicle_x_m": x,
        "vehicle_y_m": y,
        "vehicle_z_m": np.full(n, VEHICLE_Z_M),
        "vehicle_yaw_rad": yaw,
        "median_z_m": np.full(n, -DEPTH_M),
        "min_forward_m": np.zeros(n),
        "max_forward_m": np.zeros(n),
        "min_left_m": np.full(n, -HALF_SWATH_M),
        "max_left_m": np.full(n, HALF_SWATH_M),
    }
    beams = {
        "ping": np.repeat(np.arange(n), BEAMS).astype(float),
        "x_m": (x[:, None] - left * np.sin(yaw)[:, None]).ravel(),
        "y_m": (y[:, None] + left * np.cos(yaw)[:, None]).ravel(),
        "z_m": np.full(n * BEAMS, -DEPTH_M),
        "forward_m": np.zeros(n * BEAMS),
        "left_m": np.tile(left, n),
    }
    return placed, beams
