// What the core answers: beams for the map nodes, the survey for whoever writes it down.
#pragma once

#include <ros/node_handle.h>

#include <atomic>

#include "rbpf_core/particle_filter.hpp"
#include "rbpf_node/loop_closure_loop.hpp"
#include "rbpf_svgp_slam/GetPings.h"

namespace rbpf_node {

class Services {
 public:
  // Advertises ~get_minibatches, ~get_beams and ~get_pings.
  Services(ros::NodeHandle private_node, const rbpf_core::ParticleFilter& filter,
           const LoopClosureLoop& loop);

  // Minibatches served so far, all maps together: an upper bound of the training steps done. A
  // map's block of beams counts as one.
  std::uint64_t minibatchesServed() const { return minibatches_served_; }

 private:
  // For ~get_minibatches and ~get_beams.
  template <typename Request, typename Response>
  bool serveBeams(Request& request, Response& response);
  bool getPings(rbpf_svgp_slam::GetPings::Request& request,
                rbpf_svgp_slam::GetPings::Response& response);

  const rbpf_core::ParticleFilter& filter_;
  const LoopClosureLoop& loop_;
  std::atomic<std::uint64_t> minibatches_served_{0};
  ros::ServiceServer minibatch_server_;
  ros::ServiceServer beam_server_;
  ros::ServiceServer ping_server_;
};

}  // namespace rbpf_node
