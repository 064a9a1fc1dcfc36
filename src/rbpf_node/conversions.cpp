#include "rbpf_node/conversions.hpp"

#include <cmath>
#include <stdexcept>

#include "rbpf_core/motion_model.hpp"

namespace rbpf_node {

Eigen::Isometry3d toIsometry(const rbpf_core::Pose2& pose, const rbpf_core::Attitude& attitude) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() << pose.x_m, pose.y_m, attitude.z_m;
  T.linear() = Eigen::AngleAxisd(pose.yaw_rad, Eigen::Vector3d::UnitZ()) *
               rbpf_core::levelRotation(attitude.roll_rad, attitude.pitch_rad);
  return T;
}

geometry_msgs::Pose toPose(const rbpf_core::Pose2& pose, const rbpf_core::Attitude& attitude) {
  const Eigen::Isometry3d T = toIsometry(pose, attitude);
  const Eigen::Quaterniond q(T.rotation());
  geometry_msgs::Pose message;
  message.position.x = pose.x_m;
  message.position.y = pose.y_m;
  message.position.z = attitude.z_m;
  message.orientation.x = q.x();
  message.orientation.y = q.y();
  message.orientation.z = q.z();
  message.orientation.w = q.w();
  return message;
}

rbpf_core::Beams placeBeams(const rbpf_core::Beams& levelled_m, const rbpf_core::Pose2& pose) {
  const auto c = static_cast<float>(std::cos(pose.yaw_rad));
  const auto s = static_cast<float>(std::sin(pose.yaw_rad));
  rbpf_core::Beams placed = levelled_m;
  placed.row(0) = c * levelled_m.row(0) - s * levelled_m.row(1);
  placed.row(1) = s * levelled_m.row(0) + c * levelled_m.row(1);
  placed.row(0).array() += static_cast<float>(pose.x_m);
  placed.row(1).array() += static_cast<float>(pose.y_m);
  return placed;
}

std::vector<float> toFloats(const std::vector<std::uint8_t>& bytes, std::size_t count,
                            const std::string& name) {
  if (bytes.size() != count * sizeof(float)) {
    throw std::invalid_argument(name + " holds " + std::to_string(bytes.size()) +
                                " bytes, expected " + std::to_string(count * sizeof(float)));
  }
  std::vector<float> values(count);
  std::memcpy(values.data(), bytes.data(), bytes.size());
  return values;
}

}  // namespace rbpf_node
