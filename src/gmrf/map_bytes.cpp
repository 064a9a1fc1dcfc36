#include "gmrf/map_bytes.hpp"

#include <cmath>
#include <cstring>
#include <stdexcept>

#include "gmrf/cell.hpp"
#include "gmrf/hash.hpp"

namespace gmrf {

namespace {

constexpr char kMagic[4] = {'G', 'M', 'R', 'F'};
constexpr std::uint32_t kVersion = 1;
using Nodes = decltype(Tile::nodes);
static_assert(sizeof(Nodes) == Tile::kNodes * Tile::kNodes * 6 * sizeof(float), "no padding");

struct Header {
  char magic[4];
  std::uint32_t version;
  double spacing_m;
  double reference_m;
  std::uint64_t tiles;
};
static_assert(sizeof(Header) == 32, "no padding");

struct TileHeader {
  std::int32_t i, j;
  std::uint64_t hash;
  std::uint64_t included;
};
static_assert(sizeof(TileHeader) == 24, "no padding");

template <typename Value>
void put(const Value& value, std::string* bytes) {
  bytes->append(reinterpret_cast<const char*>(&value), sizeof(Value));
}

[[noreturn]] void refuse(const std::string& what) {
  throw std::invalid_argument("bytes of a map " + what);
}

class Reader {
 public:
  explicit Reader(const std::string& bytes) : bytes_(bytes) {}

  template <typename Value>
  void take(Value* value) {
    if (bytes_.size() - position_ < sizeof(Value)) {
      refuse("end after " + std::to_string(bytes_.size()) + " bytes; expected more");
    }
    std::memcpy(static_cast<void*>(value), bytes_.data() + position_, sizeof(Value));
    position_ += sizeof(Value);
  }
  std::size_t position() const { return position_; }

 private:
  const std::string& bytes_;
  std::size_t position_ = 0;
};

std::string text(const TileHeader& tile) {
  return "tile (" + std::to_string(tile.i) + ", " + std::to_string(tile.j) + ")";
}

// Where cells are, so that no number of a node overflows.
void expectOnGrid(const TileHeader& tile) {
  constexpr double kFarthestTile = kFarthestNode / Tile::kCells;
  if (std::abs(1.0 * tile.i) <= kFarthestTile && std::abs(1.0 * tile.j) <= kFarthestTile) return;
  refuse("hold " + text(tile) + "; expected tiles near the survey");
}

void expectFinite(const Tile& tile) {
  for (const NodeSums& node : tile.nodes) {
    const float sum = node.self + node.along_j + node.along_i + node.along_both +
                      node.along_opposed + node.information;
    if (!std::isfinite(sum)) refuse("hold a sum that is not finite");
  }
}

}  // namespace

std::string toBytes(Map& map, KnownTiles* known, TilePool* pool) {
  const Map frozen = map.share();  // whoever writes next, writes to copies
  std::string bytes;
  Header header{
      {}, kVersion, frozen.spacing_m(), frozen.reference_m(), frozen.sums().entries().size()};
  std::memcpy(header.magic, kMagic, sizeof(kMagic));
  put(header, &bytes);
  for (const TiledSums::Entry& entry : frozen.sums().entries()) {
    const std::uint64_t hash = entry.tile->contentHash();
    const bool included = known->hashes.insert(hash).second;
    put(TileHeader{entry.index.i, entry.index.j, hash, included ? 1U : 0U}, &bytes);
    if (included) put(entry.tile->nodes, &bytes);
    pool->add(entry.tile);
  }
  put(hashOf(bytes.data(), bytes.size()), &bytes);
  return bytes;
}

Map fromBytes(const std::string& bytes, TilePool* pool) {
  Reader reader(bytes);
  Header header;
  reader.take(&header);
  if (std::memcmp(header.magic, kMagic, sizeof(kMagic)) != 0) {
    refuse("do not begin with GMRF; expected those of a map of the engine gmrf");
  }
  if (header.version != kVersion) {
    refuse("are of version " + std::to_string(header.version) + "; expected " +
           std::to_string(kVersion));
  }
  std::uint64_t sum;
  if (bytes.size() < sizeof(header) + sizeof(sum)) refuse("end early; expected a hash");
  std::memcpy(&sum, bytes.data() + bytes.size() - sizeof(sum), sizeof(sum));
  if (sum != hashOf(bytes.data(), bytes.size() - sizeof(sum))) {
    refuse("are damaged or cut off: their hash is not the one that was written");
  }
  Map map(header.spacing_m, header.reference_m);
  for (std::uint64_t t = 0; t < header.tiles; ++t) {
    TileHeader tile_header;
    reader.take(&tile_header);
    expectOnGrid(tile_header);
    std::shared_ptr<const Tile> tile = pool->find(tile_header.hash);
    if (tile_header.included != 0) {
      const auto received = std::make_shared<Tile>();
      reader.take(&received->nodes);
      expectFinite(*received);
      if (tile == nullptr) tile = received;
    }
    if (tile == nullptr) {
      refuse("lack " + text(tile_header) + ", which this node does not have either");
    }
    if (tile->contentHash() != tile_header.hash) refuse("hold a tile that is not the one named");
    pool->add(tile);
    map.sums().append({tile_header.i, tile_header.j}, std::move(tile));
  }
  if (reader.position() + sizeof(sum) != bytes.size()) refuse("go on after their end");
  return map;
}

}  // namespace gmrf
