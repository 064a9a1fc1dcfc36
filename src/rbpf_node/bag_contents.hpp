// What a bag holds, before anything of it is used.
#pragma once

#include <rosbag/bag.h>

#include <string>

namespace rbpf_node {

// JSON: {"topics": [{"name", "type", "messages", "begin_s", "end_s" (record times), "is_odometry",
// "is_pings" (of a type that is taken as such), "frame", "child_frame" (of the first message of
// such a topic)}, ...]}.
std::string bagContents(const rosbag::Bag& bag);

}  // namespace rbpf_node
