#include "rbpf_node/inputs/from_pose_with_covariance.hpp"

namespace rbpf_node {

FixInput fromPoseWithCovariance(const geometry_msgs::PoseWithCovarianceStamped& message) {
  const auto& p = message.pose.pose.position;
  const auto& c = message.pose.covariance;
  FixInput input;
  input.stamp = message.header.stamp;
  input.position = PlanePosition{withoutSlash(message.header.frame_id), {p.x, p.y}};
  // [6, 6], rows x, y, z, ...
  Eigen::Matrix2d covariance_m2;
  covariance_m2 << c[0], c[1], c[6], c[7];
  if (!covariance_m2.isZero(0.0)) input.covariance_m2 = covariance_m2;
  return input;
}

}  // namespace rbpf_node
