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

// Counted from 1; rounds: see TakeTurn.srv.
struct Turn {
  std::uint32_t number = 0;
  std::uint32_t rounds = 0;
};

class Turns {
 public:
  // `ended` is asked all the time by whoever waits: true once nobody may wait any longer.
  Turns(std::size_t nodes, std::function<bool()> ended);

  // A node's side: has finished turn `done` (0: none yet) and waits for the one after it, which it
  // gets once more if the answer to an earlier call was lost. Nothing if all is over. Throws
  // std::invalid_argument if there is no such node, or no such turn has been granted.
  std::optional<Turn> take(const rbpf_svgp_slam::MapStatus& status, std::uint32_t done);

  // The replay's side: waits until every node has finished its turn; false: all is over before
  // that. `meanwhile` is called about ten times a second with the nodes that are waited for.
  using Meanwhile = std::function<void(const std::vector<std::uint32_t>& busy)>;
  bool awaitAll(const Meanwhile& meanwhile);

  // A turn for every node, all of which must have finished their last one.
  void grant(std::uint32_t rounds);

  // What the nodes said when they finished their last turn.
  std::vector<rbpf_svgp_slam::MapStatus> states() const;

  // Ends all waiting: there are no more turns. To be called before the callback queue of the nodes'
  // calls is stopped.
  void close();

 private:
  struct Node {
    rbpf_svgp_slam::MapStatus status;
    std::uint32_t done = 0;
  };

  std::vector<std::uint32_t> busy() const;

  const std::size_t nodes_;
  const std::function<bool()> ended_;
  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  std::map<std::uint32_t, Node> known_;  // nodes that have asked
  Turn granted_;                         // the newest
  bool closed_ = false;
};

}  // namespace rbpf_node
