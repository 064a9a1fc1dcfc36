// What the vehicle's navigation says of it at one instant, whatever message it came in.
#pragma once

#include <ros/time.h>

#include <Eigen/Geometry>
#include <string>

#include "rbpf_core/types.hpp"
#include "rbpf_node/frames.hpp"

namespace rbpf_node {

struct OdometryInput {
  ros::Time stamp;
  // of the pose; neither has a slash before it
  std::string frame;
  // whose pose it is, and of the twist
  std::string child_frame;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  // as it came: its norm need not be 1
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d linear_mps = Eigen::Vector3d::Zero();
  Eigen::Vector3d angular_radps = Eigen::Vector3d::Zero();
};

// Throws Refusal if the frames are others, a value is not finite or the orientation is no rotation.
rbpf_core::Odometry toOdometry(const OdometryInput& input, const Frames& frames);

// Roll, pitch, yaw of a rotation, R = Rz(yaw) Ry(pitch) Rx(roll), rad.
Eigen::Vector3d rollPitchYaw(const Eigen::Quaterniond& rotation);

}  // namespace rbpf_node
