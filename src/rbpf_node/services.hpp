// What the core answers: beams for the map nodes, the survey for whoever writes it down.
#pragma once

#include <ros/node_handle.h>

#include "rbpf_core/loop_closing.hpp"
#include "rbpf_node/smoothing_worker.hpp"
#include "rbpf_svgp_slam/GetClosures.h"
#include "rbpf_svgp_slam/GetFixes.h"
#include "rbpf_svgp_slam/GetPings.h"

namespace rbpf_node {

class Services {
 public:
  // Advertises ~get_minibatches, ~get_beams, ~get_pings, ~get_closures and ~get_fixes.
  // survey: its token.
  Services(ros::NodeHandle private_node, std::uint64_t survey,
           const rbpf_core::ParticleFilter& filter, const rbpf_core::LoopClosing& loop_closing,
           const SmoothingWorker& smoothing);

 private:
  // For ~get_minibatches and ~get_beams.
  template <typename Request, typename Response>
  bool serveBeams(Request& request, Response& response);
  bool getPings(rbpf_svgp_slam::GetPings::Request& request,
                rbpf_svgp_slam::GetPings::Response& response);
  bool getClosures(rbpf_svgp_slam::GetClosures::Request& request,
                   rbpf_svgp_slam::GetClosures::Response& response);
  bool getFixes(rbpf_svgp_slam::GetFixes::Request& request,
                rbpf_svgp_slam::GetFixes::Response& response);

  const std::uint64_t survey_;
  const rbpf_core::ParticleFilter& filter_;
  const rbpf_core::LoopClosing& loop_closing_;
  const SmoothingWorker& smoothing_;
  ros::ServiceServer minibatch_server_;
  ros::ServiceServer beam_server_;
  ros::ServiceServer ping_server_;
  ros::ServiceServer closure_server_;
  ros::ServiceServer fix_server_;
};

}  // namespace rbpf_node
