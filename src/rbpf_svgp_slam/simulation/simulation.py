"""One survey from its mission, terrain and seed: everything that a bag will hold, without ROS."""

import dataclasses

import numpy as np

from rbpf_svgp_slam.bags.recorded_survey import Mount, OdometryNoise, RecordedSurvey, Trajectory
from rbpf_svgp_slam.simulation import SurveyError, sonar
from rbpf_svgp_slam.simulation.dead_reckoning import simulate_dead_reckoning
from rbpf_svgp_slam.simulation.mission import Mission, plan_waypoints
from rbpf_svgp_slam.simulation.sonar import Pings, SonarNoise, simulate_pings
from rbpf_svgp_slam.simulation.terrain import Terrain, generate_terrain, load_terrain
from rbpf_svgp_slam.simulation.vehicle import simulate_vehicle

START_S = 1_700_000_000  # any fixed time: the same survey gives the same bag


@dataclasses.dataclass(frozen=True)
class Survey:
    """The simulated survey; odometry is the dead-reckoned Trajectory, in the odom frame."""

    mission: Mission
    terrain: Terrain
    truth: Trajectory
    odometry: Trajectory
    pings: Pings

    def area_m(self):
        """Corners [4, 2] of the map-frame rectangle that holds every footprint, in whole metres.

        Clipped to the terrain.
        """
        lower, upper = np.floor(self.pings.box_m[0]), np.ceil(self.pings.box_m[1])
        (x_lo, y_lo), (x_hi, y_hi) = np.clip(
            [lower, upper], self.terrain.origin_m, self.terrain.upper_m
        )
        return np.array([[x_lo, y_lo], [x_hi, y_lo], [x_hi, y_hi], [x_lo, y_hi]])

    def recorded(self):
        """The RecordedSurvey that the vehicle would bring home."""
        noise = self.mission.dead_reckoning
        names = (field.name for field in dataclasses.fields(OdometryNoise))
        return RecordedSurvey(
            start_s=START_S,
            odometry=self.odometry,
            odometry_noise=OdometryNoise(**{name: getattr(noise, name) for name in names}),
            mount=Mount(sonar.MOUNT_TRANSLATION_M, sonar.MOUNT_RPY_RAD),
            ping_time_s=self.pings.time_s,
            ping_points_m=self.pings.points_m,
            ground_truth=self.truth,
        )


def simulate_survey(
    mission,
    seed,
    terrain_path=None,
    noise=SonarNoise(),
    max_duration_s=np.inf,
    progress=lambda share: None,
):
    """Simulate a mission over a terrain file, or over generated terrain where there is none."""
    # A stream each: another sonar or another drift leaves terrain and motion as they were.
    terrain_rng, vehicle_rng, sonar_rng, drift_rng = map(
        np.random.default_rng, np.random.SeedSequence(seed).spawn(4)
    )
    terrain = make_terrain(mission, terrain_path, terrain_rng)
    truth = simulate_vehicle(mission, plan_waypoints(mission), terrain, vehicle_rng, max_duration_s)
    odometry = simulate_dead_reckoning(truth, mission.dead_reckoning, drift_rng)
    pings = simulate_pings(terrain, truth, mission, noise, sonar_rng, progress)
    return Survey(mission, terrain, truth, odometry, pings)


def make_terrain(mission, terrain_path, rng):
    """The terrain file, checked to hold the mission's area, or generated terrain around it."""
    area_m = np.array(mission.area_m)
    if terrain_path is None:
        lower_m, upper_m = -mission.margin_m * np.ones(2), area_m + mission.margin_m
        return generate_terrain(
            lower_m,
            upper_m,
            mission.terrain_resolution_m,
            mission.seabed_m,
            rng,
            mission.relief,
        )
    terrain = load_terrain(terrain_path, centre_m=0.5 * area_m)
    if (terrain.origin_m > 0).any() or (terrain.upper_m < area_m).any():
        (x_lo, y_lo), (x_hi, y_hi) = terrain.origin_m, terrain.upper_m
        raise SurveyError(
            f"terrain {terrain_path}: covers x {x_lo:.1f} .. {x_hi:.1f} m, "
            f"y {y_lo:.1f} .. {y_hi:.1f} m in the map frame; {mission.name} needs "
            f"x 0.0 .. {area_m[0]:.1f} m, y 0.0 .. {area_m[1]:.1f} m (a smaller scale needs less)"
        )
    return terrain
