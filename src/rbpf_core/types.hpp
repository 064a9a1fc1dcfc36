// What goes in and out of the filter. Metres, radians, seconds; frames after REP 103: x forward, y
// left, z up.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace rbpf_core {

// Pose in the horizontal plane: all that particles differ in.
struct Pose2 {
  double x_m = 0.0;
  double y_m = 0.0;
  double yaw_rad = 0.0;
};

// Depth and attitude, known from the pressure sensor and the AHRS, the same for all particles.
struct Attitude {
  // Of base_link in map, negative under water.
  double z_m = 0.0;
  double roll_rad = 0.0;
  double pitch_rad = 0.0;
};

// One odometry message: the vehicle's own pose and its body twist.
struct Odometry {
  double stamp_s = 0.0;
  // In odom. The first one is the start; the motion is taken from it where the twist cannot be
  // used.
  Pose2 pose;
  Attitude attitude;
  // Surge, sway, heave, in base_link.
  Eigen::Vector3d linear_mps = Eigen::Vector3d::Zero();
  // p, q, r, in base_link.
  Eigen::Vector3d angular_radps = Eigen::Vector3d::Zero();
};

using Beams = Eigen::Matrix3Xf;  // one column a beam

// One ping as it leaves the sensor's static mount.
struct Ping {
  double stamp_s = 0.0;
  // The sensor's place in base_link; ranges count from here.
  Eigen::Vector3f sensor_m = Eigen::Vector3f::Zero();
  // [3, n] in base_link; may hold NaN.
  Beams beams_m;
  // The beams are given in the odometry's own frame instead, as of a driver that has placed them
  // with its pose at the ping's stamp; they are taken back by it. Ranges count from base_link then.
  bool in_odometry_frame = false;
};

// A ping and where each particle saw it.
struct PlacedPing {
  double stamp_s = 0.0;
  // Its number in the survey.
  std::uint32_t index = 0;
  // [3, n] x, y in the levelled body frame, z in map: a particle's pose does the rest.
  Beams levelled_m;
  // [J], in map.
  std::vector<Pose2> poses;
};

// The maps' predictions of one ping, row j by particle j's map at its own beam positions, latent
// (noise not included).
struct PingPrediction {
  Eigen::ArrayXXd mean_m;            // [J, n]
  Eigen::ArrayXXd variance_m2;       // [J, n]
  Eigen::ArrayXd prior_variance_m2;  // [J]
};

}  // namespace rbpf_core
