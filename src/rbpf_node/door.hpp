// The one way in for messages, live and from a bag.
#pragma once

#include <geometry_msgs/PoseWithCovarianceStamped.h>

#include "rbpf_node/inputs/message_types.hpp"
#include "rbpf_node/node.hpp"

namespace rbpf_node {

class Door {
 public:
  explicit Door(SlamNode* slam) : slam_(*slam) {}

  // Hands on what a message of a topic says. One that is not what it should be is refused: the node
  // counts it and says why. receipt_s: when it came, or was recorded.
  void takeIn(rbpf_core::InputKind kind, const RawMessage& message, double receipt_s);

  // What RViz's "2D Pose Estimate" gives; refused as fixes are.
  void takeInitialPose(const geometry_msgs::PoseWithCovarianceStamped& message, double receipt_s);

 private:
  template <typename Take>
  void attempt(rbpf_core::InputKind kind, const Take& take);

  SlamNode& slam_;
};

}  // namespace rbpf_node
