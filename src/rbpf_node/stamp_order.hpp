// A bag's odometry, pings and fixes in the order in which they were measured.
#pragma once

#include <rosbag/bag.h>
#include <rosbag/message_instance.h>

#include <set>
#include <string>
#include <vector>

#include "rbpf_node/inputs/message_types.hpp"
#include "rbpf_node/parameters.hpp"

namespace rbpf_node {

struct StampedMessage {
  // the header's
  ros::Time stamp;
  rbpf_core::InputKind kind;
  rosbag::MessageInstance instance;
};

struct StampOrder {
  std::vector<StampedMessage> messages;
  // s: from the first to the last stamp that is not another clock's
  double begin_s = 0.0;
  double end_s = 0.0;
  // how far stamps lie ahead of the times at which they were recorded, s; see clockOffset
  double clock_offset_s = 0.0;
  // of the sensors that pings come from
  std::set<std::string> ping_frames;
  // messages that hold no header, or have no stamp
  rbpf_core::RefusalCounts refused;
};

// Opens a bag to be read. Throws std::runtime_error that names it, and what is wrong with it.
void openBag(const std::string& path, rosbag::Bag* bag);

// Opens a bag and checks that it holds the topics, of types that are taken; fixes may be missing.
// Returns their names as the bag has them (see topicInBag), empty for what is missing. Throws
// std::runtime_error that names the bag, and what is wrong with it.
OfflineTopics openBag(const std::string& path, const OfflineTopics& topics, rosbag::Bag* bag);

// All messages of the topics by header.stamp, whenever they were received; odometry before a ping
// of the same stamp, so that the ping need not wait for the next one. They refer to the bag.
StampOrder inStampOrder(const rosbag::Bag& bag, const OfflineTopics& topics,
                        const rbpf_core::ClockParams& clock);

}  // namespace rbpf_node
