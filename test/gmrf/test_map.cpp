#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <limits>
#include <set>
#include <stdexcept>
#include <thread>

#include "dense_field.hpp"
#include "gmrf/hash.hpp"
#include "gmrf/many_maps.hpp"
#include "gmrf/map.hpp"
#include "gmrf/map_bytes.hpp"
#include "gmrf/window.hpp"

namespace gmrf {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

double ripples(double x_m, double y_m) {
  return -80.0 + 0.6 * std::sin(0.4 * x_m) + 0.3 * std::cos(0.7 * y_m);
}

// In units of what the field's own standard deviation is: sums are kept in single precision.
void expectEqual(const Prediction& a, const Prediction& b, double tolerance) {
  ASSERT_EQ(a.mean_m.size(), b.mean_m.size());
  for (Eigen::Index p = 0; p < a.mean_m.size(); ++p) {
    EXPECT_NEAR(a.mean_m(p), b.mean_m(p), tolerance * std::sqrt(b.variance_m2(p))) << p;
    EXPECT_NEAR(a.variance_m2(p), b.variance_m2(p), tolerance * b.variance_m2(p)) << p;
  }
}

// ---- predictions -------------------------------------------------------------------------------

// Beams between the first and the last of the points, all within the points' one window.
void expectDensePrediction(const Beams& beams, const Points& points) {
  const FieldModel field(Model{2.0, 14.0, 1.5, 0.01});
  const Eigen::VectorXd weights = Eigen::VectorXd::LinSpaced(beams.cols(), 0.1, 1.0);
  Map map(2.0, -77.0);  // 3 m above the data's mean
  map.fold(beams, weights);
  const Prediction prediction = map.predict(points, field);

  const Window window(placesOf(points, 2.0), kMargin);
  Prediction expected = densePrediction(nodesOf(window), beams, weights, -77.0, points, field);
  for (Eigen::Index p = 0; p < points.cols(); ++p) {
    const CellPlace place = cellOf(points(0, p), points(1, p), 2.0);
    expected.variance_m2(p) += field.discretisation().at(place.fx, place.fy);
    ASSERT_LT(expected.variance_m2(p), 1.5) << "capped at the outputscale";
  }
  // Some ten beams a node, rounded to 6e-8 each; the depths, of 3 m, to that of 30 standard
  // deviations.
  expectEqual(prediction, expected, 1e-4);
  const Prediction mean = map.predict(points, field, Variances::kNone);
  EXPECT_TRUE(mean.mean_m.isApprox(prediction.mean_m, 1e-12));
}

TEST(Predictions, AreThoseOfADenseFieldOnARectangle) {
  const Points places = evenPoints(150, 14.0, 10.0, 1);
  Points points = cellsOf(7, 5, 2.0);
  points.row(0).array() += 0.3;
  expectDensePrediction(beamsOn(ripples, places, 0.1, 2), points);
}

TEST(Predictions, AreThoseOfADenseFieldOnASwathAcrossTheGrid) {
  Points points(2, 30);
  for (int k = 0; k < 30; ++k) points.col(k) << -20.0 + 1.1 * k, 9.0 - 0.8 * k;
  Points places(2, 120);
  for (int k = 0; k < 120; ++k) places.col(k) = points.col(k / 4).array() + 0.9 * (k % 4);
  expectDensePrediction(beamsOn(ripples, places, 0.1, 3), points);
}

TEST(Predictions, OfNothingAreThePrior) {
  const FieldModel field(Model{2.0, 14.0, 1.5, 0.01});
  Map map(2.0, -77.0);
  Points points(2, 3);
  points << 0.0, 40.0, 1e6, 0.0, -3e3, -1e6;
  for (const bool beams_elsewhere : {false, true}) {
    if (beams_elsewhere) {
      const Beams beams = Eigen::Vector3d(5000.0, 5000.0, -20.0);
      map.fold(beams, fullWeights(beams));
    }
    const Prediction prediction = map.predict(points, field);
    EXPECT_EQ(prediction.mean_m, Eigen::Vector3d::Constant(-77.0));
    EXPECT_EQ(prediction.variance_m2, Eigen::Vector3d::Constant(1.5));
  }
  EXPECT_EQ(map.predict(Points(2, 0), field).mean_m.size(), 0);
}

TEST(Predictions, OfManyPointsAreThoseOfEachOnDenseBeams) {
  const FieldModel field(Model{1.0, 10.0, 1.0, 0.01});
  Map map(1.0, -80.0);
  const Beams beams = beamsOn(ripples, evenPoints(6000, 120.0, 30.0, 4), 0.1, 5);
  map.fold(beams, fullWeights(beams));
  const Points points = evenPoints(300, 120.0, 30.0, 6);  // more than one window holds
  const Prediction together = map.predict(points, field);
  for (Eigen::Index p = 0; p < points.cols(); p += 7) {
    const Prediction alone = map.predict(points.col(p), field);
    const double std_m = std::sqrt(together.variance_m2(p));
    EXPECT_NEAR(alone.mean_m(0), together.mean_m(p), 0.5 * std_m);  // as in Truncation
    EXPECT_NEAR(alone.variance_m2(0) / together.variance_m2(p), 1.0, 0.1);
  }
}

TEST(Predictions, AreRefusedUnderAModelOfAnotherSpacing) {
  const Map map(2.0, -77.0);
  const FieldModel other(Model{1.0, 14.0, 1.5, 0.01});
  EXPECT_THROW(map.predict(Points::Zero(2, 1), other), std::invalid_argument);
}

TEST(Predictions, DoNotDependOnTheOrderOfBeams) {
  const FieldModel field(Model{2.0, 14.0, 1.5, 0.01});
  const Beams beams = beamsOn(ripples, evenPoints(2000, 50.0, 40.0, 7), 0.1, 8);
  const Eigen::VectorXd weights = Eigen::VectorXd::LinSpaced(beams.cols(), 0.1, 1.0);
  Map forwards(2.0, -77.0);
  forwards.fold(beams, weights);
  Map backwards(2.0, -77.0);
  backwards.fold(beams.rowwise().reverse(), weights.reverse());
  const Points points = evenPoints(50, 50.0, 40.0, 9);
  // Single precision, of depths of 30 standard deviations.
  expectEqual(forwards.predict(points, field), backwards.predict(points, field), 1e-3);
}

// Shifted by whole nodes, the same beams lie otherwise about the tiles' borders.
TEST(Predictions, DoNotShowTheTilesBorders) {
  const FieldModel field(Model{2.0, 14.0, 1.5, 0.01});
  const Beams beams = beamsOn(ripples, evenPoints(500, 40.0, 30.0, 10), 0.1, 11);
  Points points = evenPoints(80, 40.0, 30.0, 12);
  for (int k = 0; k < 16; ++k) points.col(k) << 30.0 + 4.0 * k, 15.0;  // away from the beams
  const auto shifted = [&](int di, int dj) {
    const Eigen::Vector2d by(2.0 * di, 2.0 * dj);
    Beams there = beams;
    there.topRows<2>().colwise() += by;
    Map map(2.0, -77.0);
    map.fold(there, fullWeights(there));
    Prediction each{Eigen::VectorXd(points.cols()), Eigen::VectorXd(points.cols())};
    for (Eigen::Index p = 0; p < points.cols(); ++p) {
      const Prediction one = map.predict(points.col(p) + by, field);
      each.mean_m(p) = one.mean_m(0);
      each.variance_m2(p) = one.variance_m2(0);
    }
    return each;
  };
  const Prediction here = shifted(0, 0);
  for (const auto& [di, dj] : {std::pair(5, 0), {0, 11}, {-7, 3}, {-40, -1}, {8, 8}}) {
    SCOPED_TRACE(testing::Message() << di << ", " << dj);
    expectEqual(shifted(di, dj), here, 1e-3);  // other sums of single precision
  }
}

// A ping is predicted from a window of its own, which leaves out what lies further than the margin.
TEST(Truncation, CostsLittleOnDenseBeams) {
  const FieldModel field(Model{1.0, 20.0, 1.0, 0.01});
  Map map(1.0, -77.0);
  const Beams beams = beamsOn(ripples, evenPoints(1000, 44.0, 44.0, 13), 0.1, 14);
  map.fold(beams, fullWeights(beams));  // one beam to two cells

  const Window whole(placesOf(cellsOf(44, 44, 1.0), 1.0), kMargin);
  EnvelopeMatrix A = priorPrecision(whole, field.model());
  Eigen::VectorXd x = addData(whole, map.sums(), field.beamVariance(), &A).information;
  A.factorise();
  A.solve(&x);
  const EnvelopeMatrix S = A.inverse();

  for (const double heading_deg : {0.0, 20.0, 45.0, 70.0, 90.0, 135.0}) {
    Points ping(2, 60);
    const Eigen::Rotation2Dd turn(heading_deg * M_PI / 180.0);
    for (int k = 0; k < 60; ++k) {
      ping.col(k) = Eigen::Vector2d(22.3, 21.9) + turn * Eigen::Vector2d(0.0, 0.5 * (k - 29.5));
    }
    const Prediction own = map.predict(ping, field);
    const Eigen::MatrixXd phi = denseInterpolation(nodesOf(whole), ping, 1.0);
    for (int k = 0; k < 60; ++k) {
      SCOPED_TRACE(testing::Message() << heading_deg << " degrees, beam " << k);
      std::vector<int> corner;
      for (int n = 0; n < whole.nodes(); ++n) {
        if (phi(k, n) > 0.0) corner.push_back(n);
      }
      const CellPlace place = cellOf(ping(0, k), ping(1, k), 1.0);
      double variance = field.discretisation().at(place.fx, place.fy);
      for (const int a : corner) {
        for (const int b : corner) {
          variance += phi(k, a) * phi(k, b) * S.at(std::max(a, b), std::min(a, b));
        }
      }
      EXPECT_NEAR(own.mean_m(k), phi.row(k).dot(x) - 77.0, 0.5 * std::sqrt(variance));
      EXPECT_NEAR(own.variance_m2(k) / variance, 1.0, 0.1);
    }
  }
}

// Over many held-out points of a seabed that was drawn from the model. Where beams are dense the
// field is somewhat better than it says: what the grid cannot represent is counted as each beam's
// own noise, though the beams of a cell share it.
TEST(Predictions, ErrAboutAsMuchAsTheySay) {
  const FieldModel field(Model{1.0, 20.0, 2.0, 0.04});
  const DrawnSeabed seabed(60.0, 40.0, field.model(), -80.0, 15);
  const auto depth = [&](double x_m, double y_m) { return seabed.at(x_m, y_m); };
  for (const int beams_per_node : {1, 4}) {
    const Beams beams = beamsOn(depth, evenPoints(2400 * beams_per_node, 60.0, 40.0, 16), 0.2, 17);
    Map map(1.0, -80.0);
    map.fold(beams, fullWeights(beams));
    const Points held_out = evenPoints(1500, 60.0, 40.0, 18);
    const Beams truth = beamsOn(depth, held_out, 0.0, 1);
    const Prediction prediction = map.predict(held_out, field);
    const Eigen::ArrayXd error = prediction.mean_m.transpose() - truth.row(2);
    const double mean_squared = (error.square() / prediction.variance_m2.array()).mean();
    EXPECT_GT(mean_squared, 0.7) << beams_per_node;
    EXPECT_LT(mean_squared, 1.5) << beams_per_node;
  }
}

TEST(NodesWithData, AreTheCornersOfTheBeamsCells) {
  Map map(2.0, -77.0);
  EXPECT_EQ(map.nodesWithData().cols(), 0);
  Beams beams(3, 2);
  beams << 1.0, -1.0, 1.0, 31.0, -80.0, -80.0;  // cells (0, 0) and (-1, 15), before a border
  map.fold(beams, fullWeights(beams));
  std::set<std::pair<double, double>> nodes;
  const Points found = map.nodesWithData();
  for (Eigen::Index n = 0; n < found.cols(); ++n) nodes.emplace(found(0, n), found(1, n));
  // The second beam's corners beyond the border belong to tiles in which no beam has been.
  EXPECT_EQ(nodes.count({0.0, 0.0}) + nodes.count({2.0, 2.0}) + nodes.count({-2.0, 30.0}), 3U);
  EXPECT_EQ(nodes.count({4.0, 4.0}) + nodes.count({-2.0, 28.0}), 0U);
  EXPECT_EQ(static_cast<Eigen::Index>(nodes.size()), found.cols());  // none twice
}

// ---- copies ------------------------------------------------------------------------------------

Map surveyedMap() {
  Map map(1.0, -77.0);
  const Beams beams = beamsOn(ripples, evenPoints(2000, 60.0, 40.0, 19), 0.1, 20);
  map.fold(beams, fullWeights(beams));
  return map;
}

std::set<const Tile*> tilesOf(const Map& map) {
  std::set<const Tile*> tiles;
  for (const TiledSums::Entry& entry : map.sums().entries()) tiles.insert(entry.tile.get());
  return tiles;
}

std::size_t inCommon(const Map& a, const Map& b) {
  const std::set<const Tile*> tiles = tilesOf(b);
  std::size_t count = 0;
  for (const Tile* tile : tilesOf(a)) count += tiles.count(tile);
  return count;
}

// Of all that the map holds: equal for equal maps.
std::uint64_t digest(Map* map) {
  KnownTiles known;
  TilePool pool;
  const std::string bytes = toBytes(*map, &known, &pool);
  return hashOf(bytes.data(), bytes.size());
}

TEST(Copies, HaveAllTilesInCommonUntilOneIsWrittenTo) {
  Map map = surveyedMap();
  Map copy = map.share();
  const std::size_t tiles = map.sums().entries().size();
  ASSERT_GE(tiles, 12U);
  EXPECT_EQ(inCommon(map, copy), tiles);
  const Beams beam = Eigen::Vector3d(5.0, 5.0, -79.0);
  copy.fold(beam, fullWeights(beam));
  EXPECT_EQ(inCommon(map, copy), tiles - 1);
  const std::set<const Tile*> before = tilesOf(copy);
  copy.fold(beam, fullWeights(beam));
  EXPECT_EQ(tilesOf(copy), before) << "a tile of its own is copied again";
}

TEST(Copies, DoNotSeeEachOthersBeams) {
  Map untouched = surveyedMap();
  const std::uint64_t before = digest(&untouched);
  const Beams beam = Eigen::Vector3d(5.0, 5.0, -60.0);
  const Beams other = Eigen::Vector3d(5.5, 25.0, -90.0);
  Map map = surveyedMap();
  Map copy = map.share();
  Map grandchild = copy.share();
  copy.fold(beam, fullWeights(beam));
  EXPECT_EQ(digest(&map), before);
  EXPECT_EQ(digest(&grandchild), before);
  const std::uint64_t copied = digest(&copy);
  EXPECT_NE(copied, before);
  map.fold(other, fullWeights(other));
  EXPECT_EQ(digest(&copy), copied);
  EXPECT_EQ(digest(&grandchild), before);

  Map alone = surveyedMap();
  alone.fold(beam, fullWeights(beam));
  EXPECT_EQ(digest(&alone), copied) << "a copy goes on as its original would have";
}

TEST(Copies, AreUsedByDifferentThreads) {
  const FieldModel field(Model{1.0, 10.0, 1.0, 0.01});
  const Points points = evenPoints(40, 60.0, 40.0, 21);
  constexpr std::uint32_t kThreads = 4;
  const auto work = [&](Map* map, std::uint32_t seed) {
    for (std::uint32_t round = 0; round < 3; ++round) {
      const Beams beams = beamsOn(ripples, evenPoints(60, 60.0, 40.0, seed + round), 0.1, 22);
      map->fold(beams, fullWeights(beams));
      map->predict(points, field);
      *map = map->share();
      digest(map);
    }
  };
  Map map = surveyedMap();
  std::vector<Map> copies;
  for (std::uint32_t t = 0; t < kThreads; ++t) copies.push_back(map.share());
  std::vector<std::thread> threads;
  for (std::uint32_t t = 0; t < kThreads; ++t) threads.emplace_back(work, &copies[t], 100 * t);
  work(&map, 100 * kThreads);
  for (std::thread& thread : threads) thread.join();
  for (std::uint32_t t = 0; t < kThreads; ++t) {
    Map alone = surveyedMap();
    work(&alone, 100 * t);
    EXPECT_EQ(digest(&copies[t]), digest(&alone)) << t;
  }
}

// ---- many maps ---------------------------------------------------------------------------------

LevelledBlock twoPings() {
  LevelledBlock block;
  block.beams_m.resize(3, 5);
  block.beams_m << 0.0F, 0.1F, -0.2F, 0.3F, 0.0F, -8.0F, 0.0F, 7.5F, -4.0F, 9.0F, -80.0F, -80.3F,
      -79.6F, -80.1F, -80.2F;
  block.ping = {0, 0, 0, 1, 1};
  block.pings = 2;
  return block;
}

// Of two maps: poses [maps, pings].
std::vector<PlacingPose> posesOfTwo() {
  const auto pose = [](double x_m, double y_m, double yaw_rad) {
    return PlacingPose{x_m, y_m, static_cast<float>(std::cos(yaw_rad)),
                       static_cast<float>(std::sin(yaw_rad))};
  };
  return {pose(10.0, 20.0, 0.3), pose(11.0, 20.5, 0.35), pose(-300.0, 7.0, -2.0),
          pose(-301.0, 6.5, -1.9)};
}

TEST(FoldIntoAll, IsAFoldOfEachMapsOwnPlaces) {
  const LevelledBlock block = twoPings();
  const std::vector<PlacingPose> poses = posesOfTwo();
  const Eigen::VectorXd weights = Eigen::VectorXd::LinSpaced(5, 0.2, 1.0);
  Map a(1.0, -77.0);
  Map b = a.share();
  foldIntoAll({&a, &b}, block, poses, weights);
  Map* const maps[] = {&a, &b};
  for (std::size_t m = 0; m < 2; ++m) {
    Beams beams(3, 5);
    for (Eigen::Index i = 0; i < 5; ++i) {
      const PlacingPose& pose = poses[2 * m + (i < 3 ? 0 : 1)];
      Eigen::Matrix2d turn;
      turn << pose.cos_yaw, -pose.sin_yaw, pose.sin_yaw, pose.cos_yaw;
      const Eigen::Vector3d beam = block.beams_m.col(i).cast<double>();
      beams.col(i) << Eigen::Vector2d(pose.x_m, pose.y_m) + turn * beam.head<2>(), beam.z();
    }
    EXPECT_TRUE(block.placed(&poses[2 * m]).isApprox(beams, 1e-14)) << m;
    Map alone(1.0, -77.0);
    alone.fold(block.placed(&poses[2 * m]), weights);
    EXPECT_EQ(digest(maps[m]), digest(&alone)) << m;
  }
}

TEST(FoldIntoAll, TakesABlockWithoutBeams) {
  Map map = surveyedMap();
  const std::uint64_t before = digest(&map);
  foldIntoAll({&map}, LevelledBlock{}, {}, Eigen::VectorXd());
  EXPECT_EQ(digest(&map), before);
}

TEST(FoldIntoAll, RefusesAllOfABlockOrNothing) {
  Map a = surveyedMap();
  Map b = a.share();
  const std::uint64_t before = digest(&a);
  const auto expectRefused = [&](const char* what, const auto& spoil) {
    LevelledBlock block = twoPings();
    std::vector<PlacingPose> poses = posesOfTwo();
    Eigen::VectorXd weights = Eigen::VectorXd::Ones(5);
    spoil(&block, &poses, &weights);
    EXPECT_THROW(foldIntoAll({&a, &b}, block, poses, weights), std::invalid_argument) << what;
    EXPECT_EQ(digest(&a), before) << what;
    EXPECT_EQ(digest(&b), before) << what;
  };
  using Block = LevelledBlock*;
  using Poses = std::vector<PlacingPose>*;
  using Weights = Eigen::VectorXd*;
  expectRefused("a pose too few", [](Block, Poses poses, Weights) { poses->pop_back(); });
  expectRefused("a pose too many", [](Block, Poses poses, Weights) { poses->push_back({}); });
  expectRefused("another ping", [](Block block, Poses, Weights) { block->ping[4] = 2; });
  expectRefused("a beam's ping lacks", [](Block block, Poses, Weights) { block->ping.pop_back(); });
  expectRefused("a weight too few", [](Block, Poses, Weights weights) { weights->resize(4); });
  expectRefused("weight negative", [](Block, Poses, Weights weights) { (*weights)(4) = -0.1; });
  expectRefused("weight NaN", [](Block, Poses, Weights weights) { (*weights)(4) = kNaN; });
  expectRefused("the last map's pose NaN",
                [](Block, Poses poses, Weights) { (*poses)[3].x_m = kNaN; });
  expectRefused("absurd pose", [](Block, Poses poses, Weights) { (*poses)[3].y_m = 1e12; });
  expectRefused("yaw NaN",
                [](Block, Poses poses, Weights) { (*poses)[3].cos_yaw = std::nanf(""); });
  for (const double bad : {kNaN, kInfinity}) {
    for (const int row : {0, 1, 2}) {
      expectRefused("beam not finite", [&](Block block, Poses, Weights) {
        block->beams_m(row, 4) = static_cast<float>(bad);
      });
    }
  }
}

// ---- refusals ----------------------------------------------------------------------------------

TEST(Fold, RefusesBadBeamsBeforeItTakesAnyIn) {
  Map map = surveyedMap();
  const std::uint64_t before = digest(&map);
  const Beams beams = beamsOn(ripples, evenPoints(5, 60.0, 40.0, 23), 0.1, 24);
  const Eigen::VectorXd weights = fullWeights(beams);
  // Depths and weights are summed in single precision, where 1e39 is infinite.
  for (const double bad : {kNaN, kInfinity, -kInfinity, 1e12, 1e39, -1e300}) {
    for (const int row : {0, 1, 2}) {
      Beams spoilt = beams;
      spoilt(row, 4) = bad;
      EXPECT_THROW(map.fold(spoilt, weights), std::invalid_argument) << row << ": " << bad;
    }
  }
  for (const double bad : {kNaN, kInfinity, -0.1, -kInfinity, 1e39}) {
    Eigen::VectorXd spoilt = weights;
    spoilt(4) = bad;
    EXPECT_THROW(map.fold(beams, spoilt), std::invalid_argument) << "weight " << bad;
  }
  EXPECT_THROW(map.fold(beams, weights.head(4)), std::invalid_argument);
  EXPECT_EQ(digest(&map), before);
  map.fold(beams, weights);
  EXPECT_NE(digest(&map), before);
}

TEST(Predictions, AreRefusedAtBadPoints) {
  const Map map = surveyedMap();
  const FieldModel field(Model{1.0, 10.0, 1.0, 0.01});
  for (const double bad : {kNaN, kInfinity, -kInfinity, 1e12}) {
    for (const int row : {0, 1}) {
      Points points = Points::Zero(2, 3);
      points(row, 2) = bad;
      EXPECT_THROW(map.predict(points, field), std::invalid_argument) << bad;
    }
  }
}

TEST(Map, RefusesBadNumbers) {
  for (const double bad : {0.0, -1.0, kNaN, kInfinity}) {
    EXPECT_THROW(Map(bad, -77.0), std::invalid_argument) << bad;
  }
  for (const double bad : {kNaN, kInfinity}) EXPECT_THROW(Map(1.0, bad), std::invalid_argument);
}

}  // namespace
}  // namespace gmrf
