// Maps as bytes, for other nodes, for files, and for the report.
#pragma once

#include <cstdint>
#include <string>
#include <unordered_set>

#include "gmrf/map.hpp"
#include "gmrf/tile_pool.hpp"

namespace gmrf {

// Hashes of the tiles that the bytes' reader has.
struct KnownTiles {
  std::unordered_set<std::uint64_t> hashes;
};

// Little-endian: "GMRF", version, spacing, reference, number of tiles; of each tile its index, its
// hash, and its sums unless `known` has it; a hash of all that. `known` takes the tiles written, so
// that the next map for the same reader leaves them out. Tiles must not be written to afterwards,
// as their hash is kept: the map shares them with the bytes' reader, so to speak.
std::string toBytes(Map& map, KnownTiles* known, TilePool* pool);

// Throws std::invalid_argument that says what is wrong with the bytes, or which tile is neither in
// them nor in the pool.
Map fromBytes(const std::string& bytes, TilePool* pool);

}  // namespace gmrf
