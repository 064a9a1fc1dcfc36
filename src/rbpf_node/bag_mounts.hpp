// Where a bag says that sensors are mounted.
#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <rosbag/bag.h>

#include <set>
#include <string>
#include <vector>

#include "rbpf_node/frames.hpp"

namespace rbpf_node {

struct Mounts {
  std::vector<geometry_msgs::TransformStamped> first;
  // the last of those that differ from the first of their frame
  std::vector<geometry_msgs::TransformStamped> changed;
};

// All transforms of /tf_static and, for sensors to which those do not lead from the base frame,
// those of /tf that do. A way through odom or map is no mount, for the vehicle moves there; nor is
// what tf2 would ignore, with a quaternion that is no rotation.
Mounts mountsIn(const rosbag::Bag& bag, const Frames& frames, const std::set<std::string>& sensors);

}  // namespace rbpf_node
