// A ping, whatever message it came in.
#pragma once

#include <ros/time.h>
#include <std_msgs/Header.h>

#include <Eigen/Geometry>
#include <string>

#include "rbpf_core/types.hpp"

namespace rbpf_node {

struct PingInput {
  ros::Time stamp;
  // of the sensor, without a slash before it
  std::string frame;
  // [3, n] in `frame`; may hold NaN
  rbpf_core::Beams beams_m;
};

// A ping without beams yet. Throws Refusal if the header names no frame.
PingInput pingOf(const std_msgs::Header& header);

// T_base_sensor takes the ping's frame into base_link.
rbpf_core::Ping toPing(const PingInput& input, const Eigen::Isometry3d& T_base_sensor);

}  // namespace rbpf_node
