// What a smoother has found out about the past, for the particles and their histories.
#pragma once

#include <cmath>
#include <vector>

#include "rbpf_core/rigid.hpp"
#include "rbpf_core/trajectory_history.hpp"
#include "rbpf_core/types.hpp"

namespace rbpf_core {

// Of the odometry, in the levelled body frame: it measures the true velocity plus this.
struct MotionBias {
  double surge_mps = 0.0;
  double sway_mps = 0.0;
  double yaw_radps = 0.0;
};

// Rigid motions of the map frame, which take a pose h to C h, and what is known of the odometry.
struct PastCorrection {
  // One for each of the log's pings 0 .. n-1, in every particle's history.
  std::vector<Pose2> of_ping;
  // Of the pings after them, and of where the particles are now.
  Pose2 of_rest;
  // Taken off the odometry's increments from now on; replaces the bias before it.
  MotionBias bias;
};

inline Pose2 move(const Pose2& rigid, const Pose2& pose) { return compose(rigid, pose); }

// The same for many poses: no trigonometry left.
struct RigidMotion {
  double x_m = 0.0, y_m = 0.0;
  double cos_yaw = 1.0, sin_yaw = 0.0;

  static RigidMotion of(const Pose2& pose) {
    return {pose.x_m, pose.y_m, std::cos(pose.yaw_rad), std::sin(pose.yaw_rad)};
  }
};

inline HistoryPose move(const RigidMotion& rigid, const HistoryPose& pose) {
  const double c = rigid.cos_yaw;
  const double s = rigid.sin_yaw;
  return {rigid.x_m + c * pose.x_m - s * pose.y_m, rigid.y_m + s * pose.x_m + c * pose.y_m,
          static_cast<float>(c * pose.cos_yaw - s * pose.sin_yaw),
          static_cast<float>(s * pose.cos_yaw + c * pose.sin_yaw)};
}

inline HistoryPose move(const Pose2& rigid, const HistoryPose& pose) {
  return move(RigidMotion::of(rigid), pose);
}

}  // namespace rbpf_core
