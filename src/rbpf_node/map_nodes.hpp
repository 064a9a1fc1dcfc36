// The B map nodes as the core sees them: predictions, the two phases of a resampling, readiness.
#pragma once

#include <ros/node_handle.h>

#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "rbpf_core/weighting.hpp"
#include "rbpf_node/parameters.hpp"
#include "rbpf_svgp_slam/MapStatus.h"

namespace rbpf_node {

// What the map nodes last said of themselves, put together.
struct MapsState {
  std::size_t nodes_heard = 0;  // that reported under the epoch asked for
  std::size_t maps_ready = 0;   // of those nodes
  std::uint64_t steps = 0;      // training steps of all nodes since they started
};

// What a resampling brought from one node to another.
struct MovedMaps {
  std::uint32_t maps = 0;
  std::uint64_t bytes = 0;
};

class MapNodes {
 public:
  MapNodes(ros::NodeHandle node, const Parameters& params);

  const std::vector<std::uint32_t>& nodeOf() const { return node_of_; }  // [J]

  // Where the nodes' states come from: their status topics, or whoever hands them over.
  void listen();
  void takeStates(const std::vector<rbpf_svgp_slam::MapStatus>& states);

  MapsState state(std::uint32_t epoch) const;

  // Every particle's own map at that particle's positions, [J][n] x, y relative to the survey
  // origin; all nodes work at the same time. Throws std::runtime_error that names the node.
  rbpf_core::PingPrediction predict(std::uint32_t epoch,
                                    const std::vector<std::vector<float>>& positions) const;

  // First phase on all nodes at once. Throws std::runtime_error if any node failed; then
  // commit(epoch, false) is due.
  MovedMaps prepare(std::uint32_t epoch, const std::vector<std::uint32_t>& ancestors) const;

  // Second phase. Returns what went wrong, or an empty string. A node that missed it asks the core
  // itself.
  std::string commit(std::uint32_t epoch, bool commit) const;

 private:
  std::string service(std::size_t node, const std::string& name) const;

  ros::NodeHandle node_;
  const std::size_t nodes_;
  const double predict_timeout_s_;
  const double resampling_timeout_s_;
  const std::vector<std::uint32_t> node_of_;  // [J]
  std::vector<ros::Subscriber> subscribers_;
  mutable std::mutex mutex_;
  std::map<std::uint32_t, rbpf_svgp_slam::MapStatus> latest_;
};

}  // namespace rbpf_node
