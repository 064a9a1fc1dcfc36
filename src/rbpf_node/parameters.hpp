// The one place where the C++ side reads parameters. config/default.yaml explains each of them.
#pragma once

#include <ros/node_handle.h>

#include <Eigen/Core>
#include <string>
#include <vector>

#include "rbpf_core/loop_closure.hpp"
#include "rbpf_core/particle_filter.hpp"
#include "rbpf_node/frames.hpp"

namespace rbpf_node {

struct Parameters {
  std::size_t nodes = 2;  // B
  Frames frames;
  double odometry_gap_s = 2.0;
  rbpf_core::FilterParams filter;
  rbpf_core::LoopClosureParams loop_closure;
  double loop_closure_rate_hz = 0.2;
  double loop_closure_timeout_s = 10.0;
  double resampling_threshold = 0.5;
  double resampling_timeout_s = 30.0;
  double offline_steps_per_second = 100.0;
  double final_training_s = 10.0;
  double publish_rate_hz = 1.0;
  double bathymetry_voxel_m = 1.0;
};

// Reads and checks the parameter namespace `rbpf_svgp_slam` of the node's own namespace. Throws
// std::invalid_argument that names the parameter, its value and what was expected; an unknown name
// is refused too (those below svgp/ and map/ are the map nodes', which check them).
Parameters loadParameters(const ros::NodeHandle& node);

}  // namespace rbpf_node
