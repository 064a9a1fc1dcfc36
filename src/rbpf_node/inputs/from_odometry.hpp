#pragma once

#include <nav_msgs/Odometry.h>

#include "rbpf_node/inputs/odometry_input.hpp"

namespace rbpf_node {

OdometryInput fromOdometry(const nav_msgs::Odometry& message);

}  // namespace rbpf_node
