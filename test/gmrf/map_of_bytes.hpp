// A map of whatever bytes, and what a node and the report make of it.
#pragma once

#include <cstring>
#include <stdexcept>
#include <string>

#include "../fuzz/promise.hpp"
#include "dense_field.hpp"
#include "gmrf/hash.hpp"
#include "gmrf/map_bytes.hpp"

namespace gmrf {

// Where things are in the bytes: see toBytes.
constexpr std::size_t kHeader = 32;
constexpr std::size_t kTileHeader = 24;
constexpr std::size_t kTile = kTileHeader + sizeof(Tile::nodes);
constexpr std::size_t kHash = 8;

inline double slope(double x_m, double y_m) { return -30.0 + 0.05 * x_m - 0.02 * y_m; }

// A map of 2 x 2 tiles, one of which begins at node (0, 0).
inline Map smallMap() {
  Points places = evenPoints(400, 30.0, 25.0, 1);
  places.array() -= 11.0;
  const Beams beams = beamsOn(slope, places, 0.1, 2);
  Map map(1.5, -29.0);
  map.fold(beams, fullWeights(beams));
  return map;
}

inline std::string wholeBytes(Map* map) {
  KnownTiles known;
  TilePool pool;
  return toBytes(*map, &known, &pool);
}

template <typename Value>
void put(Value value, std::size_t at, std::string* bytes) {
  std::memcpy(bytes->data() + at, &value, sizeof(value));
}

// With the right hash behind them.
inline std::string withRightEnd(std::string bytes) {
  if (bytes.size() < kHash) return bytes;
  const std::size_t end = bytes.size() - kHash;
  put(hashOf(bytes.data(), end), end, &bytes);
  return bytes;
}

// With the right hash of each tile, too.
inline std::string withRightHashes(std::string bytes) {
  for (std::size_t at = kHeader; at + kTileHeader <= bytes.size(); at += kTileHeader) {
    std::uint64_t included = 0;
    std::memcpy(&included, bytes.data() + at + kTileHeader - sizeof(included), sizeof(included));
    if (included == 0) continue;
    if (at + kTile > bytes.size()) break;
    Tile tile;
    std::memcpy(tile.nodes.data(), bytes.data() + at + kTileHeader, sizeof(tile.nodes));
    put(tile.contentHash(), at + 8, &bytes);
    at += sizeof(tile.nodes);
  }
  return withRightEnd(std::move(bytes));
}

// Whether it is a map, or refused. A map predicts, or says why it does not, and is written as it
// was read.
inline bool isMap(const std::string& bytes) {
  TilePool pool;
  Map map(1.0, 0.0);
  try {
    map = fromBytes(bytes, &pool);
  } catch (const std::invalid_argument&) {
    return false;
  }
  promise(wholeBytes(&map).size() <= bytes.size(), "no more than was read");
  map.nodesWithData();
  try {
    const FieldModel field(Model{map.spacing_m(), 10.0, 1.0, 0.01});
    map.predict(Points::Zero(2, 1), field);
    map.predict(map.tileMiddles(), field);
  } catch (const std::invalid_argument&) {  // of a place
  } catch (const std::domain_error&) {      // numbers of no Gaussian
  }
  return true;
}

}  // namespace gmrf
