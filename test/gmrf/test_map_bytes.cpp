#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <stdexcept>

#include "../core/mutations.hpp"
#include "map_of_bytes.hpp"

namespace gmrf {
namespace {

// What fromBytes says against the bytes, to a node without tiles; empty: nothing.
std::string complaint(const std::string& bytes) {
  TilePool pool;
  try {
    fromBytes(bytes, &pool);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

// With values changed and the right hash behind them, as another program would write it.
template <typename Value>
std::string forged(std::string bytes, std::size_t at, Value value) {
  std::memcpy(bytes.data() + at, &value, sizeof(value));
  return withRightEnd(std::move(bytes));
}

// ---- whole maps --------------------------------------------------------------------------------

TEST(MapBytes, GiveTheSameMapBack) {
  Map map = smallMap();
  const std::string bytes = wholeBytes(&map);
  ASSERT_EQ(bytes.size(), kHeader + 4 * kTile + kHash);
  TilePool pool;
  Map restored = fromBytes(bytes, &pool);
  EXPECT_EQ(restored.spacing_m(), 1.5);
  EXPECT_EQ(restored.reference_m(), -29.0);
  EXPECT_TRUE(wholeBytes(&restored) == bytes);

  const FieldModel field(Model{1.5, 10.0, 1.0, 0.01});
  const Points points = evenPoints(20, 15.0, 10.0, 3);
  const auto expectSamePredictions = [&] {
    const Prediction a = map.predict(points, field);
    const Prediction b = restored.predict(points, field);
    EXPECT_EQ(a.mean_m, b.mean_m);
    EXPECT_EQ(a.variance_m2, b.variance_m2);
  };
  expectSamePredictions();
  const Beams more = beamsOn(slope, evenPoints(50, 40.0, 40.0, 4), 0.1, 5);
  map.fold(more, fullWeights(more));
  EXPECT_TRUE(wholeBytes(&restored) == bytes) << "they are independent";
  restored.fold(more, fullWeights(more));
  expectSamePredictions();
  EXPECT_TRUE(wholeBytes(&restored) == wholeBytes(&map));
}

TEST(MapBytes, GiveAnEmptyMapBack) {
  Map map(1.5, -29.0);
  TilePool pool;
  Map restored = fromBytes(wholeBytes(&map), &pool);
  EXPECT_TRUE(restored.sums().entries().empty());
  EXPECT_EQ(restored.reference_m(), -29.0);
}

// A written tile's hash is kept: a beam that comes later must not go into that tile.
TEST(MapBytes, ChangeWithTheMap) {
  Map map = smallMap();
  KnownTiles known;
  TilePool pool;
  const std::string before = toBytes(map, &known, &pool);
  const Beams beam = Eigen::Vector3d(2.0, 2.0, -30.0);
  map.fold(beam, fullWeights(beam));
  const std::string after = toBytes(map, &known, &pool);
  EXPECT_EQ(after.size(), kHeader + 4 * kTileHeader + sizeof(Tile::nodes) + kHash) << "one tile";
  TilePool reader;
  const Map first = fromBytes(before, &reader);
  Map second = fromBytes(after, &reader);
  EXPECT_TRUE(wholeBytes(&second) == wholeBytes(&map));
}

// ---- damage ------------------------------------------------------------------------------------

TEST(MapBytes, AreRefusedIfTheyAreCutOff) {
  Map map = smallMap();
  const std::string bytes = wholeBytes(&map);
  std::vector<std::size_t> sizes;
  for (std::size_t size = 0; size < kHeader + kTileHeader + 8; ++size) sizes.push_back(size);
  for (std::size_t tile = 1; tile <= 4; ++tile) {
    const std::size_t end = kHeader + tile * kTile;
    for (const std::size_t size : {end - 1, end, end + 1, end + kTileHeader}) {
      if (size < bytes.size()) sizes.push_back(size);
    }
  }
  sizes.push_back(bytes.size() - 1);
  for (const std::size_t size : sizes) {
    EXPECT_TRUE(contains(complaint(bytes.substr(0, size)), "bytes of a map")) << size;
  }
  EXPECT_NE(complaint(bytes + "x"), "");
}

TEST(MapBytes, AreRefusedIfABitHasFlipped) {
  Map map = smallMap();
  const std::string bytes = wholeBytes(&map);
  for (std::size_t at = 0; at < bytes.size(); at += at < kHeader + kTileHeader ? 1 : 211) {
    std::string flipped = bytes;
    flipped[at] = static_cast<char>(flipped[at] ^ (1 << at % 8));
    EXPECT_TRUE(contains(complaint(flipped), "bytes of a map")) << at;
  }
}

TEST(MapBytes, AreRefusedIfTheyAreOfSomethingElse) {
  Map map = smallMap();
  const std::string bytes = wholeBytes(&map);
  EXPECT_TRUE(contains(complaint("SVGP" + bytes.substr(4)), "expected those of a map of"));
  EXPECT_TRUE(contains(complaint(forged(bytes, 4, std::uint32_t{2})), "version 2; expected 1"));
}

TEST(MapBytes, AreRefusedWithAbsurdContent) {
  Map map = smallMap();
  const std::string bytes = wholeBytes(&map);
  const double nan = std::nan("");
  ASSERT_EQ(complaint(forged(bytes, 8, 1.5)), "");  // nothing has changed
  EXPECT_TRUE(contains(complaint(forged(bytes, 8, -1.0)), "spacing"));
  EXPECT_TRUE(contains(complaint(forged(bytes, 16, nan)), "reference"));
  EXPECT_NE(complaint(forged(bytes, 24, std::uint64_t{5})), "") << "tiles too few";
  EXPECT_NE(complaint(forged(bytes, 24, std::uint64_t{3})), "") << "tiles too many";
  EXPECT_NE(complaint(forged(bytes, 24, ~std::uint64_t{0})), "");
  EXPECT_TRUE(contains(complaint(forged(bytes, kHeader, std::int32_t{7})), "out of order"));
  EXPECT_TRUE(contains(complaint(forged(bytes, kHeader, -std::int32_t{6'250'001})), "near the"));
  EXPECT_EQ(complaint(forged(bytes, kHeader, -std::int32_t{6'250'000})), "") << "cellOf's farthest";
  for (std::size_t k = 0; k < 6; ++k) {
    const std::size_t sum = kHeader + 2 * kTile + kTileHeader + 4 * (6 * 40 + k);
    for (const float bad : {std::nanf(""), std::numeric_limits<float>::infinity()}) {
      EXPECT_TRUE(contains(complaint(forged(bytes, sum, bad)), "not finite")) << k;
    }
    EXPECT_TRUE(contains(complaint(forged(bytes, sum, 7.0F)), "not the one named")) << k;
  }
}

// Hashes are right.
TEST(MapBytes, OfDamagedContentAreAMapOrRefused) {
  Map map = smallMap();
  const std::string whole = wholeBytes(&map);
  const std::vector<std::uint8_t> bytes(whole.begin(), whole.end());
  std::size_t maps = 0;
  for (std::uint32_t seed = 0; seed < 1000; ++seed) {
    const std::vector<std::uint8_t> damaged = rbpf_core::Mutations(seed).of(bytes);
    if (isMap(withRightHashes({damaged.begin(), damaged.end()}))) ++maps;
  }
  EXPECT_GT(maps, 200U);
  EXPECT_LT(maps, 800U);
}

// ---- maps between nodes that have tiles in common ----------------------------------------------

TEST(MapBytes, CarryOnlyTheTilesThatTheReaderLacks) {
  Map map = smallMap();
  Map copy = map.share();
  const Beams beam = Eigen::Vector3d(2.0, 2.0, -30.0);
  copy.fold(beam, fullWeights(beam));
  KnownTiles known;
  TilePool sender;
  const std::string first = toBytes(map, &known, &sender);
  const std::string equal = toBytes(map, &known, &sender);
  const std::string other = toBytes(copy, &known, &sender);
  const std::size_t names = kHeader + 4 * kTileHeader + kHash;
  EXPECT_EQ(first.size(), names + 4 * sizeof(Tile::nodes));
  EXPECT_EQ(equal.size(), names);
  EXPECT_EQ(other.size(), names + sizeof(Tile::nodes));

  TilePool receiver;
  Map restored = fromBytes(first, &receiver);
  Map again = fromBytes(equal, &receiver);
  Map restored_copy = fromBytes(other, &receiver);
  EXPECT_TRUE(wholeBytes(&restored) == wholeBytes(&map));
  EXPECT_TRUE(wholeBytes(&again) == wholeBytes(&map));
  EXPECT_TRUE(wholeBytes(&restored_copy) == wholeBytes(&copy));
  for (std::size_t t = 0; t < 4; ++t) {  // the reader keeps equal tiles once
    EXPECT_EQ(restored.sums().entries()[t].tile, again.sums().entries()[t].tile);
  }
  EXPECT_EQ(receiver.hashes().size(), 5U);
}

TEST(MapBytes, NameATileThatIsMissing) {
  Map map = smallMap();
  KnownTiles known;
  TilePool sender;
  toBytes(map, &known, &sender);
  const std::string equal = toBytes(map, &known, &sender);
  EXPECT_TRUE(contains(complaint(equal), "lack tile (-1, -1)")) << complaint(equal);
}

TEST(TilePool, ForgetsTilesThatNoMapHas) {
  TilePool pool;
  KnownTiles known;
  {
    Map map = smallMap();
    toBytes(map, &known, &pool);
    EXPECT_EQ(pool.hashes().size(), 4U);
    for (const std::uint64_t hash : pool.hashes()) EXPECT_NE(pool.find(hash), nullptr);
  }
  EXPECT_TRUE(pool.hashes().empty());
  for (const std::uint64_t hash : known.hashes) EXPECT_EQ(pool.find(hash), nullptr);
}

}  // namespace
}  // namespace gmrf
