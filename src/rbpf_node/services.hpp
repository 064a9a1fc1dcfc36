// What the core answers: beams for the map nodes, the survey for whoever writes it down.
#pragma once

#include <ros/node_handle.h>

#include "rbpf_core/loop_closing.hpp"
#include "rbpf_svgp_slam/GetPings.h"

namespace rbpf_node {

class Services {
 public:
  // Advertises ~get_minibatches, ~get_beams and ~get_pings.
  Services(ros::NodeHandle private_node, const rbpf_core::ParticleFilter& filter,
           const rbpf_core::LoopClosing& loop_closing);

 private:
  // For ~get_minibatches and ~get_beams.
  template <typename Request, typename Response>
  bool serveBeams(Request& request, Response& response);
  bool getPings(rbpf_svgp_slam::GetPings::Request& request,
                rbpf_svgp_slam::GetPings::Response& response);

  const rbpf_core::ParticleFilter& filter_;
  const rbpf_core::LoopClosing& loop_closing_;
  ros::ServiceServer minibatch_server_;
  ros::ServiceServer beam_server_;
  ros::ServiceServer ping_server_;
};

}  // namespace rbpf_node
