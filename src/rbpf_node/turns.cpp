#include "rbpf_node/turns.hpp"

#include <chrono>
#include <stdexcept>
#include <string>
#include <utility>

namespace rbpf_node {

namespace {

constexpr auto kPoll = std::chrono::milliseconds(100);

}  // namespace

Turns::Turns(std::size_t nodes, std::function<bool()> ended)
    : nodes_(nodes), ended_(std::move(ended)) {}

std::optional<Turn> Turns::take(const rbpf_svgp_slam::MapStatus& status, std::uint32_t done) {
  if (status.node >= nodes_) {
    throw std::invalid_argument("node " + std::to_string(status.node) + ", expected below " +
                                std::to_string(nodes_));
  }
  std::unique_lock lock(mutex_);
  if (done > granted_.number) {
    throw std::invalid_argument("turn " + std::to_string(done) + ", expected at most " +
                                std::to_string(granted_.number) + ", the newest");
  }
  known_[status.node] = {status, done};
  changed_.notify_all();
  const auto decided = [&] { return granted_.number > done || closed_; };
  while (!changed_.wait_for(lock, kPoll, decided) && !ended_()) {
  }
  if (granted_.number == done) return std::nullopt;
  return granted_;
}

bool Turns::awaitAll(const Meanwhile& meanwhile) {
  std::unique_lock lock(mutex_);
  while (!changed_.wait_for(lock, kPoll, [this] { return closed_ || busy().empty(); })) {
    if (ended_()) return false;
    const std::vector<std::uint32_t> nodes = busy();
    lock.unlock();
    meanwhile(nodes);
    lock.lock();
  }
  return !closed_ && !ended_();
}

void Turns::grant(std::uint32_t rounds) {
  const std::lock_guard lock(mutex_);
  if (!busy().empty()) throw std::logic_error("a turn is granted while a node still works");
  granted_ = {granted_.number + 1, rounds};
  changed_.notify_all();
}

std::vector<rbpf_svgp_slam::MapStatus> Turns::states() const {
  const std::lock_guard lock(mutex_);
  std::vector<rbpf_svgp_slam::MapStatus> states;
  for (const auto& [index, node] : known_) states.push_back(node.status);
  return states;
}

void Turns::close() {
  const std::lock_guard lock(mutex_);
  closed_ = true;
  changed_.notify_all();
}

std::vector<std::uint32_t> Turns::busy() const {
  std::vector<std::uint32_t> nodes;
  for (std::uint32_t node = 0; node < nodes_; ++node) {
    const auto known = known_.find(node);
    const bool idle = known != known_.end() && known->second.done == granted_.number;
    if (!idle) nodes.push_back(node);
  }
  return nodes;
}

}  // namespace rbpf_node
