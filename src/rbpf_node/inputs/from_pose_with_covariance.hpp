#pragma once

#include <geometry_msgs/PoseWithCovarianceStamped.h>

#include "rbpf_node/inputs/fix_input.hpp"

namespace rbpf_node {

// Its x and y, with their covariance unless that is zero. Depth and orientation are left out of
// account: pressure sensor and AHRS know them.
FixInput fromPoseWithCovariance(const geometry_msgs::PoseWithCovarianceStamped& message);

// The same of a pose that an operator gives, its yaw included. Throws Refusal if the orientation is
// no rotation, or if the variances of x, y and yaw are not finite and positive.
FixInput fromInitialPose(const geometry_msgs::PoseWithCovarianceStamped& message);

}  // namespace rbpf_node
