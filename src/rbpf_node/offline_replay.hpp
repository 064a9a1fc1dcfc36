// A bag read directly: nothing is lost, whatever the speed.
#pragma once

#include <string>

#include "rbpf_node/node.hpp"

namespace rbpf_node {

struct OfflineTopics {
  std::string odometry;
  std::string pings;
};

// Hands the bag's messages to the node's handlers, in the order of the bag. After each ping it
// waits until the map nodes have been served offline/steps_per_second minibatches for every second
// of survey since there were beams to train on (0: waits for nothing), then prompts if that is due.
// Prints progress. Throws std::runtime_error if the bag cannot be read or lacks a topic.
void replayOffline(const std::string& bag_path, const OfflineTopics& topics,
                   const Parameters& params, SlamNode* slam);

}  // namespace rbpf_node
