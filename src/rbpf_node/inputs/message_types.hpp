// The types of message that are understood, live and offline.
#pragma once

#include <string>
#include <variant>

#include "rbpf_core/input_kind.hpp"
#include "rbpf_node/inputs/fix_input.hpp"
#include "rbpf_node/inputs/odometry_input.hpp"
#include "rbpf_node/inputs/ping_input.hpp"
#include "rbpf_node/inputs/raw_message.hpp"

namespace rbpf_node {

// alternatives in the order of InputKind
using AnyInput = std::variant<OdometryInput, PingInput, FixInput>;

// What a message says. Throws Refusal if something is wrong with it; a type of which topics of this
// kind cannot be is wrong too.
AnyInput readInput(rbpf_core::InputKind kind, const RawMessage& raw);

// Empty if topics of this kind may carry messages of the type, otherwise what they may carry:
// "sensor_msgs/PointCloud2 or ...".
std::string expectedInsteadOf(rbpf_core::InputKind kind, const std::string& datatype,
                              const std::string& md5sum);

}  // namespace rbpf_node
