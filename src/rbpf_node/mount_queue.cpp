#include "rbpf_node/mount_queue.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

namespace rbpf_node {

std::optional<PingInput> MountQueue::push(PingInput ping) {
  pings_.push_back(std::move(ping));
  if (pings_.size() <= capacity_) return std::nullopt;
  PingInput oldest = std::move(pings_.front());
  pings_.pop_front();
  return oldest;
}

std::optional<double> MountQueue::earliestStamp() const {
  std::optional<double> earliest_s;
  for (const PingInput& ping : pings_) {
    const double stamp_s = ping.stamp.toSec();
    earliest_s = std::min(earliest_s.value_or(stamp_s), stamp_s);
  }
  return earliest_s;
}

std::vector<std::string> MountQueue::frames() const {
  std::vector<std::string> frames;
  for (const PingInput& ping : pings_) {
    if (std::find(frames.begin(), frames.end(), ping.frame) == frames.end()) {
      frames.push_back(ping.frame);
    }
  }
  return frames;
}

std::vector<PingInput> MountQueue::take(const std::string& frame) {
  const auto others_end = std::stable_partition(
      pings_.begin(), pings_.end(), [&](const PingInput& ping) { return ping.frame != frame; });
  std::vector<PingInput> taken(std::make_move_iterator(others_end),
                               std::make_move_iterator(pings_.end()));
  pings_.erase(others_end, pings_.end());
  return taken;
}

}  // namespace rbpf_node
