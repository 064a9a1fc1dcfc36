#pragma once

#include <sensor_msgs/NavSatFix.h>

#include "rbpf_node/inputs/fix_input.hpp"

namespace rbpf_node {

// Latitude and longitude, with their covariance where its type is known; the altitude is left out
// of account. Throws Refusal if the receiver says that it has no fix.
FixInput fromNavSatFix(const sensor_msgs::NavSatFix& message);

}  // namespace rbpf_node
