// Services of the type std_srvs/Trigger.
#pragma once

#include <ros/node_handle.h>

#include <functional>
#include <string>
#include <vector>

#include "rbpf_node/asked_step.hpp"

namespace rbpf_node {

class TriggerServices {
 public:
  // Advertises on the node's callback queue.
  explicit TriggerServices(ros::NodeHandle node) : node_(std::move(node)) {}

  // What the function throws is the answer too: a failure, and why.
  void add(const std::string& name, std::function<Answer()> answer);

 private:
  ros::NodeHandle node_;
  std::vector<ros::ServiceServer> servers_;
};

}  // namespace rbpf_node
