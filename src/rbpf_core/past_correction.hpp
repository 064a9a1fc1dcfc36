// What a smoother has found out about the past, for the particles and their histories.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "rbpf_core/rigid.hpp"
#include "rbpf_core/trajectory_history.hpp"
#include "rbpf_core/types.hpp"

namespace rbpf_core {

// Of the odometry: in the levelled body frame it measures the true velocity plus the bias, and of
// that only what the vehicle does through the water, which itself flows with the current.
struct MotionBias {
  double surge_mps = 0.0;
  double sway_mps = 0.0;
  double yaw_radps = 0.0;
  // In map.
  double current_x_mps = 0.0;
  double current_y_mps = 0.0;
};

// A rigid motion of the map frame, which takes a pose h to C h, at one of the log's pings.
struct PingMotion {
  std::uint64_t ping = 0;
  Pose2 motion;
};

// Motions of the past, and what is known of the odometry.
struct PastCorrection {
  // Of the pings from 0 to the last of these, in every particle's history; in between they are
  // interpolated by the pings' numbers, which rise.
  std::vector<PingMotion> of_pings;
  // Of the pings after them, and of where the particles are now.
  Pose2 of_rest;
  // Taken off the odometry's increments from now on, and its current added to them; replaces the
  // one before it.
  MotionBias bias;
  // How often particles had been drawn anew when this was found out.
  std::uint32_t redraws = 0;
  // Whether maps are to follow, or may stay as they are: `past` is counted only if they are to.
  bool maps_follow = true;
};

// Throws std::invalid_argument that names what is not finite, or not in its order.
void expectSound(const PastCorrection& correction);

// One for each ping from 0 to the last one that is told.
std::vector<Pose2> motionOfEach(const std::vector<PingMotion>& told);

// By how much less or more a pose may be moved.
struct MotionTolerance {
  double position_m = 0.0;
  double yaw_rad = 0.0;

  bool holds(const Pose2& a, const Pose2& b) const;
};

// So few of the motions, [n], of poses, [n], that the others can be made of them.
std::vector<PingMotion> thinned(const std::vector<Pose2>& motions, const std::vector<Pose2>& poses,
                                const MotionTolerance& tolerance);

inline Pose2 move(const Pose2& rigid, const Pose2& pose) { return compose(rigid, pose); }

inline HistoryPose move(const Pose2& rigid, const HistoryPose& pose) {
  return move(RigidMotion::of(rigid), pose);
}

}  // namespace rbpf_core
