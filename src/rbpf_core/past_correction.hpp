// What a smoother has found out about the past, for the particles and their histories.
#pragma once

#include <Eigen/Core>
#include <cstdint>
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
  // How often particles had been drawn anew when this was found out.
  std::uint32_t redraws = 0;
  // Whether maps are to follow, or may stay as they are: `past` is counted only if they are to.
  bool maps_follow = true;
};

// Throws std::invalid_argument that names what is not finite.
void expectFinite(const PastCorrection& correction);

inline Pose2 move(const Pose2& rigid, const Pose2& pose) { return compose(rigid, pose); }

inline HistoryPose move(const Pose2& rigid, const HistoryPose& pose) {
  return move(RigidMotion::of(rigid), pose);
}

}  // namespace rbpf_core
