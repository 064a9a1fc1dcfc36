#include "rbpf_node/inputs/from_odometry.hpp"

namespace rbpf_node {

OdometryInput fromOdometry(const nav_msgs::Odometry& message) {
  const auto& p = message.pose.pose.position;
  const auto& q = message.pose.pose.orientation;
  const auto& v = message.twist.twist.linear;
  const auto& w = message.twist.twist.angular;
  OdometryInput input;
  input.stamp = message.header.stamp;
  input.frame = withoutSlash(message.header.frame_id);
  input.child_frame = withoutSlash(message.child_frame_id);
  input.position_m = {p.x, p.y, p.z};
  input.orientation = {q.w, q.x, q.y, q.z};
  input.linear_mps = {v.x, v.y, v.z};
  input.angular_radps = {w.x, w.y, w.z};
  return input;
}

}  // namespace rbpf_node
