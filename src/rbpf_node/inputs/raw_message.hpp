// A message of any type as it is on the wire and in a bag.
#pragma once

#include <ros/message_traits.h>
#include <ros/serialization.h>
#include <std_msgs/Header.h>

#include <cstdint>
#include <string>
#include <vector>

#include "rbpf_core/refusal.hpp"
#include "rbpf_node/inputs/array_lengths.hpp"

namespace rbpf_node {

struct RawMessage {
  // as ROS writes it: nav_msgs/Odometry
  std::string datatype;
  std::string md5sum;
  std::vector<std::uint8_t> bytes;
};

// Source: topic_tools::ShapeShifter, rosbag::MessageInstance.
template <typename Source>
RawMessage rawMessage(const Source& source) {
  RawMessage raw{source.getDataType(), source.getMD5Sum(),
                 std::vector<std::uint8_t>(source.size())};
  ros::serialization::OStream stream(raw.bytes.data(),
                                     static_cast<std::uint32_t>(raw.bytes.size()));
  source.write(stream);
  return raw;
}

// Throws Refusal if the bytes end before the message does.
template <typename Message>
Message deserialised(const RawMessage& raw) {
  // roscpp reads through pointers that are not const
  auto* bytes = const_cast<std::uint8_t*>(raw.bytes.data());
  ros::serialization::IStream stream(bytes, static_cast<std::uint32_t>(raw.bytes.size()));
  Message message;
  bool is_whole = arraysFit<Message>(raw.bytes);
  try {
    if (is_whole) ros::serialization::deserialize(stream, message);
  } catch (const ros::serialization::StreamOverrunException&) {
    is_whole = false;
  }
  if (is_whole) return message;
  throw rbpf_core::Refusal(rbpf_core::Reason::kMalformed,
                           std::to_string(raw.bytes.size()) + " bytes, expected a whole " +
                               ros::message_traits::datatype<Message>());
}

// The header that all messages of the table begin with. Throws Refusal if its stamp is zero: such a
// message has no place in time.
inline std_msgs::Header headerOf(const RawMessage& raw) {
  const auto header = deserialised<std_msgs::Header>(raw);
  if (header.stamp.isZero()) {
    throw rbpf_core::Refusal(rbpf_core::Reason::kNoStamp, "header.stamp is 0, expected a time");
  }
  return header;
}

}  // namespace rbpf_node
