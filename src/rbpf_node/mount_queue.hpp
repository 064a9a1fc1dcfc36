// Pings whose sensors' mounts are not known yet.
#pragma once

#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "rbpf_node/inputs/ping_input.hpp"

namespace rbpf_node {

class MountQueue {
 public:
  // capacity: pings of all frames together.
  explicit MountQueue(std::size_t capacity) : capacity_(capacity) {}

  // Returns the ping that has waited longest if there are now too many.
  std::optional<PingInput> push(PingInput ping);

  // The frames for whose mounts pings wait, each once.
  std::vector<std::string> frames() const;

  // The pings of a frame in the order in which they came; they wait no longer.
  std::vector<PingInput> take(const std::string& frame);

  std::size_t size() const { return pings_.size(); }

  // The earliest stamp among those that wait, s.
  std::optional<double> earliestStamp() const;

 private:
  const std::size_t capacity_;
  // in the order in which they came
  std::deque<PingInput> pings_;
};

}  // namespace rbpf_node
