// The one way in for messages, live and from a bag.
#pragma once

#include "rbpf_node/inputs/message_types.hpp"
#include "rbpf_node/node.hpp"

namespace rbpf_node {

class Door {
 public:
  explicit Door(SlamNode* slam) : slam_(*slam) {}

  // Hands on what a message of a topic says. One that is not what it should be is refused: the node
  // counts it and says why.
  void takeIn(InputKind kind, const RawMessage& message);

 private:
  SlamNode& slam_;
};

}  // namespace rbpf_node
