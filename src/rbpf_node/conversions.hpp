// From the filter's types to what is published and sent.
#pragma once

#include <geometry_msgs/Pose.h>

#include <Eigen/Geometry>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "rbpf_core/types.hpp"

namespace rbpf_node {

geometry_msgs::Pose toPose(const rbpf_core::Pose2& pose, const rbpf_core::Attitude& attitude);
Eigen::Isometry3d toIsometry(const rbpf_core::Pose2& pose, const rbpf_core::Attitude& attitude);

// A ping's beams at a pose: [3, n] in map.
rbpf_core::Beams placeBeams(const rbpf_core::Beams& levelled_m, const rbpf_core::Pose2& pose);

// Numbers as the bytes of a payload and back; payloads are little-endian, as are all machines that
// this runs on (checked where it is compiled).
static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "payloads are little-endian");

template <typename T>
void appendBytes(const T* values, std::size_t count, std::vector<std::uint8_t>* bytes) {
  const auto* first = reinterpret_cast<const std::uint8_t*>(values);
  bytes->insert(bytes->end(), first, first + count * sizeof(T));
}

// Throws std::invalid_argument unless the payload holds exactly `count` values.
std::vector<float> toFloats(const std::vector<std::uint8_t>& bytes, std::size_t count,
                            const std::string& name);

}  // namespace rbpf_node
