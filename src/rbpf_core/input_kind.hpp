#pragma once

namespace rbpf_core {

// What a topic carries. In the order in which inputs of the same stamp are handed on: a ping then
// need not wait for the next odometry.
enum class InputKind { kOdometry, kPing, kFix };

}  // namespace rbpf_core
