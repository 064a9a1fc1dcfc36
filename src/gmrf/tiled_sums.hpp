// Tiles where beams have been, shared between copies until one of them writes.
#pragma once

#include <memory>
#include <vector>

#include "gmrf/tile.hpp"

namespace gmrf {

// Tiles have whole numbers too: tile (0, 0) begins at node (0, 0).
using TileIndex = NodeIndex;

inline bool operator<(const TileIndex& a, const TileIndex& b) {
  return a.i != b.i ? a.i < b.i : a.j < b.j;
}
inline bool operator==(const TileIndex& a, const TileIndex& b) { return a.i == b.i && a.j == b.j; }

inline TileIndex tileOf(const NodeIndex& cell) {
  // Tile::kCells is a power of two: a shift rounds down, below 0 as well.
  static_assert(Tile::kCells == 16);
  return {cell.i >> 4, cell.j >> 4};
}

// One writer at a time; copies may be written by different threads.
class TiledSums {
 public:
  struct Entry {
    TileIndex index;
    std::shared_ptr<const Tile> tile;
    // This map alone points to the tile, and may write to it.
    bool own;
  };

  TiledSums() = default;
  TiledSums(TiledSums&&) = default;
  TiledSums& operator=(TiledSums&&) = default;

  // Shares all tiles: from now on neither of both writes to them.
  TiledSums share();

  void add(const CellPlace& place, double depth_m, double weight);

  // Ordered by index.
  const std::vector<Entry>& entries() const { return entries_; }
  // Null where no beam has been.
  const Tile* find(const TileIndex& index) const;
  // Tiles must be put in the order of their indices.
  void append(const TileIndex& index, std::shared_ptr<const Tile> tile);

 private:
  Tile& writable(const TileIndex& index);

  std::vector<Entry> entries_;
  std::size_t latest_ = 0;  // entry written last: the next beam is most likely there too
};

}  // namespace gmrf
