// A bag's odometry and pings in the order in which they were measured.
#pragma once

#include <rosbag/bag.h>
#include <rosbag/message_instance.h>

#include <string>
#include <vector>

namespace rbpf_node {

struct OfflineTopics {
  std::string odometry;
  std::string pings;
};

enum class InputKind { kOdometry, kPing };  // in the order in which they are handed on

struct StampedMessage {
  ros::Time stamp;  // the header's
  InputKind kind;
  rosbag::MessageInstance instance;
};

struct StampOrder {
  std::vector<StampedMessage> messages;
  std::size_t unreadable = 0;  // messages that do not hold what they should, or have no stamp
};

// Opens a bag and checks that it holds both topics. Throws std::runtime_error that names the bag
// and what is wrong with it.
void openBag(const std::string& path, const OfflineTopics& topics, rosbag::Bag* bag);

// All messages of both topics by header.stamp, whenever they were received; odometry before a ping
// of the same stamp, so that the ping need not wait for the next one. They refer to the bag.
StampOrder inStampOrder(const rosbag::Bag& bag, const OfflineTopics& topics);

}  // namespace rbpf_node
