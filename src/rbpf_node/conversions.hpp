// Between ROS messages and the filter's types. Each conversion from a message checks it and throws
// std::invalid_argument that names what was wrong, the value and what was expected.
#pragma once

#include <geometry_msgs/Pose.h>
#include <nav_msgs/Odometry.h>
#include <sensor_msgs/PointCloud2.h>

#include <Eigen/Geometry>
#include <cstring>
#include <string>
#include <vector>

#include "rbpf_core/particle_filter.hpp"
#include "rbpf_node/parameters.hpp"

namespace rbpf_node {

rbpf_core::Odometry toOdometry(const nav_msgs::Odometry& message, const Frames& frames);

// T_base_sensor takes the cloud's frame into base_link.
rbpf_core::Ping toPing(const sensor_msgs::PointCloud2& message,
                       const Eigen::Isometry3d& T_base_sensor);

geometry_msgs::Pose toPose(const rbpf_core::Pose2& pose, const rbpf_core::Attitude& attitude);
Eigen::Isometry3d toIsometry(const rbpf_core::Pose2& pose, const rbpf_core::Attitude& attitude);

// Roll, pitch, yaw of a rotation, R = Rz(yaw) Ry(pitch) Rx(roll), rad.
Eigen::Vector3d rollPitchYaw(const Eigen::Quaterniond& rotation);

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
