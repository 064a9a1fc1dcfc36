#pragma once

#include <sensor_msgs/LaserScan.h>

#include "rbpf_node/inputs/ping_input.hpp"

namespace rbpf_node {

// A fan of beams in the xy plane of the scan's frame: one beam a range within range_min ..
// range_max, at its angle from the x axis towards y. A ping is taken in one instant: times between
// rays are left out of account. Throws Refusal that names what is wrong with the
// message, the value and what was expected.
PingInput fromLaserScan(const sensor_msgs::LaserScan& message);

}  // namespace rbpf_node
