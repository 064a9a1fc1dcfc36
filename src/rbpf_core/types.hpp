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
  double z_m = 0.0;  // of base_link in map, negative under water
  double roll_rad = 0.0;
  double pitch_rad = 0.0;
};

// One odometry message: the vehicle's own pose and its body twist.
struct Odometry {
  double stamp_s = 0.0;
  Pose2 pose;         // in odom; only the first one is used, as the start
  Attitude attitude;  // z, roll, pitch
  Eigen::Vector3d linear_mps = Eigen::Vector3d::Zero();     // surge, sway, heave, in base_link
  Eigen::Vector3d angular_radps = Eigen::Vector3d::Zero();  // p, q, r, in base_link
};

using Beams = Eigen::Matrix3Xf;  // one column a beam

// One ping as it leaves the sensor's static mount.
struct Ping {
  double stamp_s = 0.0;
  Eigen::Vector3f sensor_m =
      Eigen::Vector3f::Zero();  // the sensor's place in base_link; ranges count from here
  Beams beams_m;                // [3, n] in base_link; may hold NaN
};

}  // namespace rbpf_core
