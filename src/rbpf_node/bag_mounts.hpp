// Where a bag says that sensors are mounted.
#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <rosbag/bag.h>
#include <tf2_ros/buffer.h>

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

// Tells tf2 of mounts, or of those that have come in the place of earlier ones.
void setMounts(const std::vector<geometry_msgs::TransformStamped>& mounts, const rosbag::Bag& bag,
               tf2_ros::Buffer* transforms);

}  // namespace rbpf_node
