#include "rbpf_node/inputs/from_nav_sat_fix.hpp"

#include "rbpf_core/refusal.hpp"

namespace rbpf_node {

FixInput fromNavSatFix(const sensor_msgs::NavSatFix& message) {
  if (message.status.status < sensor_msgs::NavSatStatus::STATUS_FIX) {
    throw rbpf_core::Refusal(rbpf_core::Reason::kNoFix, "the receiver's status is " +
                                                            std::to_string(message.status.status) +
                                                            ", expected 0 or more: it has no fix");
  }
  const auto& c = message.position_covariance;
  FixInput input;
  input.stamp = message.header.stamp;
  input.position = Geographic{message.latitude, message.longitude};
  // [3, 3], rows east, north, up
  Eigen::Matrix2d covariance_m2;
  covariance_m2 << c[0], c[1], c[3], c[4];
  const bool is_known =
      message.position_covariance_type != sensor_msgs::NavSatFix::COVARIANCE_TYPE_UNKNOWN;
  if (is_known && !covariance_m2.isZero(0.0)) input.covariance_m2 = covariance_m2;
  return input;
}

}  // namespace rbpf_node
