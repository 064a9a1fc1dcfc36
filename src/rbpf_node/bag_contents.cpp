#include "rbpf_node/bag_contents.hpp"

#include <nav_msgs/Odometry.h>
#include <rosbag/view.h>

#include <map>
#include <set>
#include <vector>

#include "rbpf_node/frames.hpp"
#include "rbpf_node/inputs/message_types.hpp"
#include "rbpf_node/json_text.hpp"

namespace rbpf_node {

namespace {

// By topic: its connections, one for each node that published.
using Connections = std::map<std::string, std::vector<const rosbag::ConnectionInfo*>>;

bool areTaken(const std::vector<const rosbag::ConnectionInfo*>& connections,
              rbpf_core::InputKind kind) {
  for (const rosbag::ConnectionInfo* connection : connections) {
    if (!expectedInsteadOf(kind, connection->datatype, connection->md5sum).empty()) return false;
  }
  return true;
}

std::string typesOf(const std::vector<const rosbag::ConnectionInfo*>& connections) {
  std::set<std::string> types;
  for (const rosbag::ConnectionInfo* connection : connections) types.insert(connection->datatype);
  std::string names;
  for (const std::string& type : types) names += (names.empty() ? "" : ", ") + type;
  return names;
}

struct FramesOfMessage {
  std::string frame;
  std::string child;
};

FramesOfMessage framesOf(const rosbag::MessageInstance& instance, bool is_odometry) {
  const RawMessage raw = rawMessage(instance);
  try {
    if (is_odometry) {
      const auto odometry = deserialised<nav_msgs::Odometry>(raw);
      return {withoutSlash(odometry.header.frame_id), withoutSlash(odometry.child_frame_id)};
    }
    return {withoutSlash(deserialised<std_msgs::Header>(raw).frame_id), ""};
  } catch (const rbpf_core::Refusal&) {  // counted when all are read
    return {};
  }
}

std::string describe(const rosbag::Bag& bag, const std::string& topic,
                     const std::vector<const rosbag::ConnectionInfo*>& connections) {
  rosbag::View view(bag, rosbag::TopicQuery(topic));
  const bool is_odometry = areTaken(connections, rbpf_core::InputKind::kOdometry);
  const bool is_pings = areTaken(connections, rbpf_core::InputKind::kPing);
  const bool is_empty = view.size() == 0;
  FramesOfMessage frames;
  if (!is_empty && (is_odometry || is_pings)) frames = framesOf(*view.begin(), is_odometry);
  return json::object({
      {"name", json::text(topic)},
      {"type", json::text(typesOf(connections))},
      {"messages", json::number(view.size())},
      {"begin_s", json::number(is_empty ? 0.0 : view.getBeginTime().toSec())},
      {"end_s", json::number(is_empty ? 0.0 : view.getEndTime().toSec())},
      {"is_odometry", json::boolean(is_odometry)},
      {"is_pings", json::boolean(is_pings)},
      {"frame", json::text(frames.frame)},
      {"child_frame", json::text(frames.child)},
  });
}

}  // namespace

std::string bagContents(const rosbag::Bag& bag) {
  Connections by_topic;
  for (const rosbag::ConnectionInfo* connection : rosbag::View(bag).getConnections()) {
    by_topic[connection->topic].push_back(connection);
  }
  std::vector<std::string> topics;
  for (const auto& [topic, connections] : by_topic) {
    topics.push_back(describe(bag, topic, connections));
  }
  return json::object({{"topics", json::list(topics)}});
}

}  // namespace rbpf_node
