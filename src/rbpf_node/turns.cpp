#include "rbpf_node/turns.hpp"

#include <chrono>
#include <stdexcept>
#include <utility>

namespace rbpf_node {

namespace {

constexpr auto kPoll = std::chrono::milliseconds(100);

}  // namespace

Turns::Turns(std::size_t nodes, std::function<bool()> ended)
    : nodes_(nodes), ended_(std::move(ended)) {}

std::optional<std::uint32_t> Turns::take(const rbpf_svgp_slam::MapStatus& status) {
  if (status.node >= nodes_) {
    throw std::invalid_argument("node " + std::to_string(status.node) + ", expected below " +
                                std::to_string(nodes_));
  }
  std::unique_lock lock(mutex_);
  Waiting& own = waiting_[status.node];
  const std::uint64_t ticket = ++own.ticket;
  own.status = status;
  own.idle = true;
  own.rounds.reset();
  changed_.notify_all();
  const auto decided = [&] { return own.rounds || own.ticket != ticket || closed_; };
  while (!changed_.wait_for(lock, kPoll, decided) && !ended_()) {
  }
  if (own.ticket != ticket) return std::nullopt;
  own.idle = false;
  return std::exchange(own.rounds, std::nullopt);
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
  for (auto& [node, waiting] : waiting_) {
    waiting.idle = false;
    waiting.rounds = rounds;
  }
  changed_.notify_all();
}

std::vector<rbpf_svgp_slam::MapStatus> Turns::states() const {
  const std::lock_guard lock(mutex_);
  std::vector<rbpf_svgp_slam::MapStatus> states;
  for (const auto& [node, waiting] : waiting_) states.push_back(waiting.status);
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
    const auto known = waiting_.find(node);
    if (known == waiting_.end() || !known->second.idle) nodes.push_back(node);
  }
  return nodes;
}

}  // namespace rbpf_node
