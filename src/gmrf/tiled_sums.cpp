#include "gmrf/tiled_sums.hpp"

#include <algorithm>
#include <stdexcept>

namespace gmrf {

namespace {

auto positionOf(const std::vector<TiledSums::Entry>& entries, const TileIndex& index) {
  return std::lower_bound(
      entries.begin(), entries.end(), index,
      [](const TiledSums::Entry& entry, const TileIndex& wanted) { return entry.index < wanted; });
}

}  // namespace

TiledSums TiledSums::share() {
  for (Entry& entry : entries_) entry.own = false;
  TiledSums twin;
  twin.entries_ = entries_;
  return twin;
}

void TiledSums::add(const CellPlace& place, double depth_m, double weight) {
  const TileIndex index = tileOf(place.cell);
  const CellPlace inside{
      {place.cell.i - index.i * Tile::kCells, place.cell.j - index.j * Tile::kCells},
      place.fx,
      place.fy};
  writable(index).add(inside, depth_m, weight);
}

const Tile* TiledSums::find(const TileIndex& index) const {
  const auto entry = positionOf(entries_, index);
  return entry != entries_.end() && entry->index == index ? entry->tile.get() : nullptr;
}

void TiledSums::append(const TileIndex& index, std::shared_ptr<const Tile> tile) {
  if (!entries_.empty() && !(entries_.back().index < index)) {
    throw std::invalid_argument("tile (" + std::to_string(index.i) + ", " +
                                std::to_string(index.j) + ") is out of order");
  }
  entries_.push_back({index, std::move(tile), false});
}

Tile& TiledSums::writable(const TileIndex& index) {
  if (latest_ >= entries_.size() || !(entries_[latest_].index == index)) {
    const auto place = positionOf(entries_, index);
    latest_ = static_cast<std::size_t>(place - entries_.begin());
    if (place == entries_.end() || !(place->index == index)) {
      entries_.insert(place, {index, std::make_shared<const Tile>(), true});
    }
  }
  Entry& entry = entries_[latest_];
  if (!entry.own) {
    entry.tile = std::make_shared<const Tile>(*entry.tile);
    entry.own = true;
  }
  // Nobody else points to it: it was made here, as a Tile that is not const.
  return const_cast<Tile&>(*entry.tile);
}

}  // namespace gmrf
