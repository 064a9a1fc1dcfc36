#pragma once

#include <sensor_msgs/PointCloud2.h>

#include "rbpf_node/inputs/ping_input.hpp"

namespace rbpf_node {

// One beam a point, row by row; fields in any order, float32 or float64, of either byte order,
// among whatever other fields. Throws Refusal that names what is wrong with the
// message, the value and what was expected.
PingInput fromPointCloud2(const sensor_msgs::PointCloud2& message);

}  // namespace rbpf_node
