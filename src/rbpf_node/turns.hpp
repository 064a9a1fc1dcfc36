// An offline replay and its map nodes go on in turns: while the replay takes in messages no node
// works, and while the nodes work the replay waits.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "rbpf_svgp_slam/MapStatus.h"

namespace rbpf_node {

class Turns {
 public:
  // `ended` is asked all the time by whoever waits: true once nobody may wait any longer.
  Turns(std::size_t nodes, std::function<bool()> ended);

  // A node's side: has finished its last turn and waits for the next one. Returns its rounds, or
  // nothing if there will be none: all is over, or the same node has asked once more, because it
  // lost its connection. Throws std::invalid_argument if there is no such node.
  std::optional<std::uint32_t> take(const rbpf_svgp_slam::MapStatus& status);

  // The replay's side: waits until every node has finished its turn; false: all is over before
  // that. `meanwhile` is called about ten times a second with the nodes that are waited for.
  using Meanwhile = std::function<void(const std::vector<std::uint32_t>& busy)>;
  bool awaitAll(const Meanwhile& meanwhile);

  // A turn for every node, all of which must have finished their last one.
  void grant(std::uint32_t rounds);

  // What the nodes said when they finished their last turn.
  std::vector<rbpf_svgp_slam::MapStatus> states() const;

  // Sends everybody home. To be called before the callback queue of the nodes' calls is stopped.
  void close();

 private:
  struct Waiting {
    rbpf_svgp_slam::MapStatus status;
    std::uint64_t ticket = 0;             // of the node's newest call
    bool idle = false;                    // that call waits for a turn
    std::optional<std::uint32_t> rounds;  // granted to it
  };

  std::vector<std::uint32_t> busy() const;

  const std::size_t nodes_;
  const std::function<bool()> ended_;
  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  std::map<std::uint32_t, Waiting> waiting_;
  bool closed_ = false;
};

}  // namespace rbpf_node
