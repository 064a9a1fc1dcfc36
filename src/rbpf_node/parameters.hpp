// The one place where the C++ side reads parameters. config/default.yaml explains each of them, and
// a test holds the defaults here against it.
#pragma once

#include <XmlRpcValue.h>
#include <ros/node_handle.h>

#include <Eigen/Core>
#include <string>
#include <vector>

#include "rbpf_core/input_gate.hpp"
#include "rbpf_core/particle_filter.hpp"
#include "rbpf_core/smoothing/past_smoothing.hpp"
#include "rbpf_core/weighting.hpp"
#include "rbpf_node/frames.hpp"
#include "rbpf_node/inputs/fix_input.hpp"

namespace rbpf_node {

struct Parameters {
  // B
  std::size_t nodes = 2;
  Frames frames;
  // in map
  std::vector<Eigen::Vector2d> survey_area_m;
  FixInputParams fix_input;
  rbpf_core::GateParams gate;
  rbpf_core::FilterParams filter;
  rbpf_core::WeightingParams loop_closure;
  double loop_closure_rate_hz = 0.2;
  double loop_closure_timeout_s = 10.0;
  double resampling_threshold = 0.5;
  double resampling_timeout_s = 30.0;
  rbpf_core::smoothing::PastSmoothingParams smoothing;
  double offline_steps_per_second = 100.0;
  double final_training_s = 10.0;
  double publish_rate_hz = 1.0;
  double bathymetry_voxel_m = 1.0;
  double vehicle_length_m = 5.0;
};

// Topics of a bag, as they are called in it.
struct OfflineTopics {
  std::string odometry;
  std::string pings;
  // Empty: none.
  std::string fixes;
};

// What only an offline replay is told: private parameters of its node.
struct OfflineParameters {
  std::string bag;
  OfflineTopics topics;
  // A recorder takes part, and is waited for.
  bool is_recorded = false;
};

// Checks a tree of parameters. Throws std::invalid_argument that names the parameter, its value and
// what was expected; an unknown name is refused too (those below map/ and the group of the engine
// that map/engine names are the map nodes', which check them).
Parameters validParameters(const XmlRpc::XmlRpcValue& tree);
OfflineParameters validOfflineParameters(const XmlRpc::XmlRpcValue& tree);

// Read the tree from the parameter server, and check it: the namespace `rbpf_svgp_slam` of the
// node's own namespace; ~bag, ~odom_topic, ~ping_topic, ~fix_topic, ~recorded and ~take_turns.
Parameters loadParameters(const ros::NodeHandle& node);
// The tree as the parameter server writes it, XML-RPC, for who reads it later.
std::string parametersAsXml(const ros::NodeHandle& node);
OfflineParameters loadOfflineParameters(const ros::NodeHandle& private_node);

}  // namespace rbpf_node
