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

std::string findTopic(const rosbag::Bag& bag, const std::string& name, rbpf_core::InputKind kind) {
  std::set<std::string> topics;
  for (const rosbag::ConnectionInfo* connection : rosbag::View(bag).getConnections()) {
    topics.insert(connection->topic);
  }
  const std::string topic = topicInBag(name, topics);
  const bool may_be_missing = kind == rbpf_core::InputKind::kFix;
  if (topic.empty() && may_be_missing) return "";
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

void refuse(const rosbag::MessageInstance& instance, rbpf_core::InputKind kind,
            rbpf_core::Reason reason, const std::string& what, StampOrder* order) {
  order->refused.add(kind, reason, what);
  ROS_ERROR_THROTTLE(5.0, "Message on %s, received at %.3f s, refused: %s",
                     instance.getTopic().c_str(), instance.getTime().toSec(), what.c_str());
}

void collect(const rosbag::Bag& bag, const std::string& topic, rbpf_core::InputKind kind,
             StampOrder* order) {
  rosbag::View view(bag, rosbag::TopicQuery(topic));
  for (const rosbag::MessageInstance& instance : view) {
    try {
      const std_msgs::Header header = headerOf(rawMessage(instance));
      order->messages.push_back({header.stamp, kind, instance});
      if (kind == rbpf_core::InputKind::kPing)
        order->ping_frames.insert(withoutSlash(header.frame_id));
    } catch (const rbpf_core::Refusal& refusal) {
      refuse(instance, kind, refusal.reason(), refusal.what(), order);
    } catch (const std::exception& error) {
      refuse(instance, kind, rbpf_core::Reason::kMalformed, error.what(), order);
    }
  }
}

double stampMinusReceipt(const StampedMessage& message) {
  return message.stamp.toSec() - message.instance.getTime().toSec();
}

void setTimes(const rbpf_core::ClockParams& clock, StampOrder* order) {
  std::vector<double> ahead_s;
  for (const StampedMessage& message : order->messages) {
    if (message.kind == rbpf_core::InputKind::kOdometry) {
      ahead_s.push_back(stampMinusReceipt(message));
    }
  }
  order->clock_offset_s = rbpf_core::clockOffset(std::move(ahead_s), clock);
  bool first = true;
  for (const StampedMessage& message : order->messages) {
    if (message.kind == rbpf_core::InputKind::kFix) continue;
    const double ahead = stampMinusReceipt(message) - order->clock_offset_s;
    if (ahead > clock.max_ahead_s || ahead < -clock.max_behind_s) continue;
    if (first) order->begin_s = message.stamp.toSec();
    order->end_s = message.stamp.toSec();
    first = false;
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
  return {findTopic(*bag, topics.odometry, rbpf_core::InputKind::kOdometry),
          findTopic(*bag, topics.pings, rbpf_core::InputKind::kPing),
          findTopic(*bag, topics.fixes, rbpf_core::InputKind::kFix)};
}

StampOrder inStampOrder(const rosbag::Bag& bag, const OfflineTopics& topics,
                        const rbpf_core::ClockParams& clock) {
  StampOrder order;
  collect(bag, topics.odometry, rbpf_core::InputKind::kOdometry, &order);
  collect(bag, topics.pings, rbpf_core::InputKind::kPing, &order);
  if (!topics.fixes.empty()) collect(bag, topics.fixes, rbpf_core::InputKind::kFix, &order);
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
  setTimes(clock, &order);
  return order;
}

}  // namespace rbpf_node
