#include "rbpf_node/inputs/from_pose_with_covariance.hpp"

#include <cmath>
#include <string>
#include <utility>

#include "rbpf_core/refusal.hpp"

namespace rbpf_node {

namespace {

// Messages carry rounded numbers.
constexpr double kNormTolerance = 0.01;

}  // namespace

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

FixInput fromInitialPose(const geometry_msgs::PoseWithCovarianceStamped& message) {
  const auto& q = message.pose.pose.orientation;
  const double norm = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
  if (!(std::abs(norm - 1.0) < kNormTolerance)) {
    throw rbpf_core::Refusal(
        rbpf_core::Reason::kMalformed,
        "initialpose's orientation has the norm " + std::to_string(norm) + ", expected 1");
  }
  const auto& c = message.pose.covariance;
  const std::pair<const char*, double> variances[] = {{"x", c[0]}, {"y", c[7]}, {"yaw", c[35]}};
  for (const auto& [name, variance] : variances) {
    if (std::isfinite(variance) && variance > 0.0) continue;
    throw rbpf_core::Refusal(rbpf_core::Reason::kMalformed,
                             std::string("initialpose's variance of ") + name + " is " +
                                 std::to_string(variance) + ", expected finite and above 0");
  }
  FixInput input = fromPoseWithCovariance(message);
  const double yaw_rad =
      std::atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z));
  input.heading = rbpf_core::Heading{yaw_rad, c[35]};
  return input;
}

}  // namespace rbpf_node
