// What the filter is told before it starts. Defaults are those of config/default.yaml.
#pragma once

#include <cstdint>
#include <optional>

#include "rbpf_core/fix.hpp"
#include "rbpf_core/minibatch.hpp"
#include "rbpf_core/motion_model.hpp"
#include "rbpf_core/ping_filter.hpp"

namespace rbpf_core {

constexpr std::size_t kMostParticles = 100000;

struct FilterParams {
  // J, 1 to kMostParticles
  std::size_t particles = 40;
  // Of every random number.
  std::uint64_t seed = 1;
  // In map; without one, the first odometry's own pose.
  std::optional<Pose2> start_pose;
  // Standard deviation of the start, x and y alike.
  double start_position_std_m = 0.0;
  double start_yaw_std_rad = 0.0;
  OdometryParams odometry;
  MotionNoise motion;
  PingFilterParams pings;
  FixParams fixes;
  // Pings that may wait for odometry at or after their stamps.
  std::size_t ping_queue = 1000;
  // Pings younger than this are not drawn into minibatches; 0: the paper's.
  double hold_back_s = 30.0;
  // Share of the pings that are never drawn, for evaluation.
  double holdout = 0.02;
  // The k-th minibatches of all particles hold the same beams.
  bool common_random_numbers = false;
  // From which the coordinates of minibatches count.
  Origin origin;
};

}  // namespace rbpf_core
