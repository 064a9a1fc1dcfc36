#include "rbpf_node/inputs/odometry_input.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "rbpf_core/refusal.hpp"

namespace rbpf_node {

namespace {

// Messages carry rounded quaternions.
constexpr double kNormTolerance = 0.01;

void expectFrame(const std::string& what, const std::string& frame, const std::string& expected) {
  if (frame != expected) {
    throw rbpf_core::Refusal(rbpf_core::Reason::kWrongFrame,
                             what + " is '" + frame + "', expected '" + expected + "'");
  }
}

void expectFinite(const std::string& what, const Eigen::Vector3d& values) {
  if (values.allFinite()) return;
  std::ostringstream text;
  text << "odometry's " << what << " is (" << values.x() << ", " << values.y() << ", " << values.z()
       << "), expected finite numbers";
  throw rbpf_core::Refusal(rbpf_core::Reason::kNotFinite, text.str());
}

void expectRotation(const Eigen::Quaterniond& orientation) {
  const double norm = orientation.norm();
  if (std::abs(norm - 1.0) < kNormTolerance) return;
  throw rbpf_core::Refusal(
      std::isfinite(norm) ? rbpf_core::Reason::kMalformed : rbpf_core::Reason::kNotFinite,
      "odometry's orientation has the norm " + std::to_string(norm) + ", expected 1");
}

}  // namespace

Eigen::Vector3d rollPitchYaw(const Eigen::Quaterniond& rotation) {
  const Eigen::Matrix3d R = rotation.toRotationMatrix();
  return {std::atan2(R(2, 1), R(2, 2)), std::asin(std::clamp(-R(2, 0), -1.0, 1.0)),
          std::atan2(R(1, 0), R(0, 0))};
}

rbpf_core::Odometry toOdometry(const OdometryInput& input, const Frames& frames) {
  // a pose that is given in map, as of a navigation that has GPS, does as well
  if (input.frame != frames.map) {
    expectFrame("odometry's header.frame_id", input.frame, frames.odom);
  }
  // drivers that leave it empty mean the vehicle
  if (!input.child_frame.empty()) {
    expectFrame("odometry's child_frame_id", input.child_frame, frames.base);
  }
  expectFinite("position", input.position_m);
  expectFinite("linear velocity", input.linear_mps);
  expectFinite("angular velocity", input.angular_radps);
  expectRotation(input.orientation);
  const Eigen::Vector3d rpy = rollPitchYaw(input.orientation.normalized());
  const Eigen::Vector3d& p = input.position_m;
  return {input.stamp.toSec(),
          {p.x(), p.y(), rpy.z()},
          {p.z(), rpy.x(), rpy.y()},
          input.linear_mps,
          input.angular_radps};
}

}  // namespace rbpf_node
