"""Seabeds, noise and beams of small simulated surveys, for the simulator's tests."""

import numpy as np
from scipy.spatial.transform import Rotation

from rbpf_svgp_slam.bags.recorded_survey import rotation_from_rpy
from rbpf_svgp_slam.simulation import sonar
from rbpf_svgp_slam.simulation.dead_reckoning import DeadReckoningNoise
from rbpf_svgp_slam.simulation.mission import get_mission, plan_waypoints
from rbpf_svgp_slam.simulation.simulation import make_terrain
from rbpf_svgp_slam.simulation.terrain import Terrain
from rbpf_svgp_slam.simulation.vehicle import simulate_vehicle

QUIET = sonar.SonarNoise(range_fraction=0, angle_rad=0, outlier_share=0, nan_share=0)
EXACT = DeadReckoningNoise(0, 0, 0, 0, 0, 0, 0)
# The caster bisects to within 1 mm along the ray.
CAST_TOLERANCE_M = 1.1e-3


def plane(slope_x=0.0, slope_y=0.0, resolution_m=1.0):
    """z = -30 + slope_x x + slope_y y over x, y in -100 .. 100 m."""
    axis_m = np.arange(-100, 100 + resolution_m, resolution_m)
    z_m = -30 + slope_x * axis_m[:, None] + slope_y * axis_m[None, :]
    return Terrain(z_m.astype(np.float32), resolution_m, np.array([-100.0, -100.0]))


def generated(mission, seed=0):
    return make_terrain(mission, None, np.random.default_rng(seed))


def quarter_of_the_demo():
    """A quarter of the demo: lines in both directions and all turns, over generated terrain."""
    mission = get_mission("demo", 0.25)
    terrain = generated(mission)
    waypoints_m = plan_waypoints(mission)
    truth = simulate_vehicle(mission, waypoints_m, terrain, np.random.default_rng(1))
    return mission, terrain, waypoints_m, truth


def beams_in_map(pings, truth):
    """All beams [N, 3], brought into the map frame with the true poses."""
    position_m, rpy_rad = truth.poses_at(pings.time_s)
    mount = Rotation.from_euler("xyz", sonar.MOUNT_RPY_RAD)
    points_m = []
    for ping_m, translation_m, rotation in zip(
        pings.points_m, position_m, rotation_from_rpy(rpy_rad)
    ):
        body_m = mount.apply(ping_m) + sonar.MOUNT_TRANSLATION_M
        points_m.append(rotation.apply(body_m) + translation_m)
    return np.vstack(points_m)
