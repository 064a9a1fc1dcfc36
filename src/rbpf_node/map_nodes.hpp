// The B map nodes as the core sees them: the maps of Algorithm 2, reached by ROS services.
#pragma once

#include <ros/node_handle.h>

#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "rbpf_core/maps.hpp"
#include "rbpf_node/parameters.hpp"
#include "rbpf_svgp_slam/MapStatus.h"

namespace rbpf_node {

// What is wrong with a status that came from that node, whose particles these are; empty if
// nothing.
std::string problemWith(const rbpf_svgp_slam::MapStatus& status, std::size_t node,
                        const std::vector<std::uint32_t>& particles);

// Calls all nodes at the same time. What goes wrong is thrown as a std::runtime_error that names
// each node that failed, or a std::invalid_argument that names the answer which is malformed.
class MapNodes : public rbpf_core::Maps {
 public:
  // survey: maps of another one are none of ours; 0: the only one that there is.
  MapNodes(ros::NodeHandle node, const Parameters& params, std::uint64_t survey = 0);

  // Where the nodes' states come from: their status topics, or whoever hands them over.
  void listen();
  void takeStates(const std::vector<rbpf_svgp_slam::MapStatus>& states);

  // s of wall time since each node that has ever been heard of was so last.
  std::map<std::size_t, double> silence() const;

  rbpf_core::MapsState state(std::uint32_t epoch) const override;
  const std::vector<std::uint32_t>& nodeOf() const override { return node_of_; }
  rbpf_core::PingPrediction predict(std::uint32_t epoch,
                                    const rbpf_core::PlacedPing& ping) override;
  rbpf_core::MovedMaps prepare(std::uint32_t epoch,
                               const std::vector<std::uint32_t>& ancestors) override;
  void commit(std::uint32_t epoch) override { endResampling(epoch, true); }
  void abort(std::uint32_t epoch) override { endResampling(epoch, false); }

 private:
  struct Heard {
    rbpf_svgp_slam::MapStatus status;
    ros::WallTime at;
  };

  // A status of that node; one that cannot be its own is logged, and not used.
  void hear(std::size_t node, const rbpf_svgp_slam::MapStatus& status);
  std::string service(std::size_t node, const std::string& name) const;
  std::vector<std::string> services(const std::string& name) const;
  void endResampling(std::uint32_t epoch, bool commit) const;

  ros::NodeHandle node_;
  const std::size_t nodes_;
  const std::uint64_t survey_;
  const rbpf_core::Origin origin_;
  const double predict_timeout_s_;
  const double resampling_timeout_s_;
  const std::vector<std::uint32_t> node_of_;              // [J]
  std::vector<std::vector<std::uint32_t>> particles_of_;  // [B]
  std::vector<ros::Subscriber> subscribers_;
  mutable std::mutex mutex_;  // guards latest_
  std::map<std::size_t, Heard> latest_;
};

}  // namespace rbpf_node
