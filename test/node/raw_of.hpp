// A message as it is on the wire or in a bag.
#pragma once

#include <ros/message_traits.h>
#include <ros/serialization.h>

#include <cstdint>
#include <vector>

#include "rbpf_node/inputs/raw_message.hpp"

namespace rbpf_node {

template <typename Message>
RawMessage rawOf(const Message& message) {
  RawMessage raw{ros::message_traits::datatype<Message>(), ros::message_traits::md5sum<Message>(),
                 std::vector<std::uint8_t>(ros::serialization::serializationLength(message))};
  ros::serialization::OStream stream(raw.bytes.data(),
                                     static_cast<std::uint32_t>(raw.bytes.size()));
  ros::serialization::serialize(stream, message);
  return raw;
}

}  // namespace rbpf_node
