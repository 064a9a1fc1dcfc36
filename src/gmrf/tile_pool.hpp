// Tiles by the hash of their content: what two nodes have in common need not travel.
#pragma once

#include <cstdint>
#include <memory>
#include <unordered_map>
#include <vector>

#include "gmrf/tile.hpp"

namespace gmrf {

// Of the tiles that have been sent or received, those that some map still has. Used by one thread
// at a time.
class TilePool {
 public:
  void add(const std::shared_ptr<const Tile>& tile) { tiles_[tile->contentHash()] = tile; }

  // Null if there is none.
  std::shared_ptr<const Tile> find(std::uint64_t hash) const {
    const auto entry = tiles_.find(hash);
    return entry == tiles_.end() ? nullptr : entry->second.lock();
  }

  // Hashes of those that are left; the others are forgotten.
  std::vector<std::uint64_t> hashes() {
    std::vector<std::uint64_t> left;
    for (auto entry = tiles_.begin(); entry != tiles_.end();) {
      if (entry->second.expired()) {
        entry = tiles_.erase(entry);
      } else {
        left.push_back((entry++)->first);
      }
    }
    return left;
  }

 private:
  std::unordered_map<std::uint64_t, std::weak_ptr<const Tile>> tiles_;
};

}  // namespace gmrf
