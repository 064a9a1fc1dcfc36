// Where a bag says that sensors are mounted.
#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <rosbag/bag.h>

#include <set>
#include <string>
#include <vector>

#include "rbpf_node/frames.hpp"

namespace rbpf_node {

// All transforms of /tf_static and, for sensors to which those do not lead from the base frame,
// those of /tf that do: the first of each, with a warning if a later one differs. A way through
// odom or map is no mount, for the vehicle moves there.
std::vector<geometry_msgs::TransformStamped> mountsIn(const rosbag::Bag& bag, const Frames& frames,
                                                      const std::set<std::string>& sensors);

}  // namespace rbpf_node
