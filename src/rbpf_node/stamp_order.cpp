#include "rbpf_node/stamp_order.hpp"

#include <ros/console.h>
#include <rosbag/exceptions.h>
#include <rosbag/view.h>

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "rbpf_node/bag_topics.hpp"

namespace rbpf_node {

namespace {

std::string findTopic(const rosbag::Bag& bag, const std::string& name, InputKind kind) {
  std::set<std::string> topics;
  for (const rosbag::ConnectionInfo* connection : rosbag::View(bag).getConnections()) {
    topics.insert(connection->topic);
  }
  const std::string topic = topicInBag(name, topics);
  if (topic.empty()) {
    std::string known;
    for (const std::string& one : topics) known += (known.empty() ? "" : ", ") + one;
    throw std::runtime_error(bag.getFileName() + " holds no message on " + name +
                             "; its topics are " + (known.empty() ? "none" : known));
  }
  rosbag::View view(bag, rosbag::TopicQuery(topic));
  for (const rosbag::ConnectionInfo* connection : view.getConnections()) {
    const std::string expected = expectedInsteadOf(kind, connection->datatype, connection->md5sum);
    if (expected.empty()) continue;
    throw std::runtime_error(bag.getFileName() + " holds " + connection->datatype + " on " + topic +
                             ", expected " + expected);
  }
  return topic;
}

void refuse(const rosbag::MessageInstance& instance, InputKind kind, Reason reason,
            const std::string& what, StampOrder* order) {
  order->refused.add(kind, reason, what);
  ROS_ERROR_THROTTLE(5.0, "Message on %s, received at %.3f s, refused: %s",
                     instance.getTopic().c_str(), instance.getTime().toSec(), what.c_str());
}

void collect(const rosbag::Bag& bag, const std::string& topic, InputKind kind, StampOrder* order) {
  rosbag::View view(bag, rosbag::TopicQuery(topic));
  for (const rosbag::MessageInstance& instance : view) {
    try {
      const std_msgs::Header header = headerOf(rawMessage(instance));
      order->messages.push_back({header.stamp, kind, instance});
      if (kind == InputKind::kPing) order->ping_frames.insert(withoutSlash(header.frame_id));
    } catch (const Refusal& refusal) {
      refuse(instance, kind, refusal.reason(), refusal.what(), order);
    } catch (const std::exception& error) {
      refuse(instance, kind, Reason::kMalformed, error.what(), order);
    }
  }
}

}  // namespace

void openBag(const std::string& path, rosbag::Bag* bag) {
  try {
    bag->open(path, rosbag::bagmode::Read);
  } catch (const rosbag::BagException& error) {
    throw std::runtime_error(path + " cannot be read: " + error.what() +
                             ". If its recording was cut off, rosbag reindex may mend it");
  }
}

OfflineTopics openBag(const std::string& path, const OfflineTopics& topics, rosbag::Bag* bag) {
  openBag(path, bag);
  return {findTopic(*bag, topics.odometry, InputKind::kOdometry),
          findTopic(*bag, topics.pings, InputKind::kPing)};
}

StampOrder inStampOrder(const rosbag::Bag& bag, const OfflineTopics& topics) {
  StampOrder order;
  collect(bag, topics.odometry, InputKind::kOdometry, &order);
  collect(bag, topics.pings, InputKind::kPing, &order);
  if (order.messages.empty()) {
    throw std::runtime_error(bag.getFileName() + " holds no message that can be read");
  }
  // a MessageInstance cannot be assigned: indices are sorted instead
  std::vector<std::size_t> by_stamp(order.messages.size());
  std::iota(by_stamp.begin(), by_stamp.end(), 0);
  std::stable_sort(by_stamp.begin(), by_stamp.end(), [&](std::size_t a, std::size_t b) {
    const StampedMessage& first = order.messages[a];
    const StampedMessage& second = order.messages[b];
    return std::tie(first.stamp, first.kind) < std::tie(second.stamp, second.kind);
  });
  std::vector<StampedMessage> sorted;
  sorted.reserve(by_stamp.size());
  for (const std::size_t i : by_stamp) sorted.push_back(order.messages[i]);
  order.messages = std::move(sorted);
  return order;
}

}  // namespace rbpf_node
