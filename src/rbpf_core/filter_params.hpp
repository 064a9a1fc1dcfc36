// What the filter is told before it starts.
#pragma once

#include <cstdint>
#include <optional>

#include "rbpf_core/minibatch.hpp"
#include "rbpf_core/motion_model.hpp"
#include "rbpf_core/ping_filter.hpp"

namespace rbpf_core {

struct FilterParams {
  std::size_t particles = 40;  // J
  std::uint64_t seed = 1;
  std::optional<Pose2> start_pose;  // in map; without one, the first odometry's own pose
  double start_position_std_m = 0.0;
  double start_yaw_std_rad = 0.0;
  MotionNoise motion;
  PingFilterParams pings;
  std::size_t ping_queue = 200;  // pings that may wait for odometry
  double hold_back_s =
      30.0;               // pings younger than this are not drawn into minibatches; 0: the paper's
  double holdout = 0.02;  // share of pings never drawn
  bool common_random_numbers = false;  // the k-th minibatches of all particles: the same beams
  Origin origin;                       // of minibatch coordinates
};

}  // namespace rbpf_core
