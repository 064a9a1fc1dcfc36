#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "rbpf_core/smoothing/local_map.hpp"
#include "seabed.hpp"

namespace rbpf_core::smoothing {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr double kLength_m = 60.0;
constexpr double kWidth_m = 40.0;

// Root mean squares of the map's errors on a grid over the rectangle, a margin left out.
struct Errors {
  double z_m = 0.0;
  double slope = 0.0;
  double known = 0.0;  // share
};

Errors errorsOf(const LocalMap& map, const Seabed& seabed, const Pose2& pose = {}) {
  Errors errors;
  int all = 0;
  int known = 0;
  for (double x = -25.0; x <= 25.0; x += 0.7) {
    for (double y = -17.0; y <= 17.0; y += 0.7) {
      ++all;
      const LocalMap::Look look = map.at(static_cast<float>(x), static_cast<float>(y));
      if (!look.known) continue;
      ++known;
      const Pose2 at = compose(pose, {x, y, 0.0});
      errors.z_m += std::pow(look.z_m - seabed.z_m(at.x_m, at.y_m), 2);
      const Eigen::Vector2d slope = seabed.slopeAt(at.x_m, at.y_m);
      errors.slope += (Eigen::Vector2d(look.slope_x, look.slope_y) - slope).squaredNorm() / 2.0;
    }
  }
  errors.z_m = std::sqrt(errors.z_m / known);
  errors.slope = std::sqrt(errors.slope / known);
  errors.known = static_cast<double>(known) / all;
  return errors;
}

LocalMap mapOf(const Seabed& seabed, Eigen::Index beams, const Sounding& sounding = {}) {
  return LocalMap(beamsAbout(seabed, {}, kLength_m, kWidth_m, beams, 1, sounding));
}

// 1 m of relief (slopes of some 0.2), three beams to a square metre.
TEST(LocalMap, HasTheSeabedAndItsSlope) {
  const Seabed seabed = Seabed::relief(1.0, 1);
  const LocalMap map = mapOf(seabed, 7200);
  const Errors errors = errorsOf(map, seabed);
  EXPECT_EQ(errors.known, 1.0);
  // Eight beams of 0.1 m to a node would leave 0.035 m; a wave of 12 m is 0.02 m off the chord
  // between nodes 1.6 m apart.
  EXPECT_LT(errors.z_m, 0.05);
  // Twice the nodes' errors over their distance.
  EXPECT_LT(errors.slope, 0.06);
}

TEST(LocalMap, HasThemInNoiselessBeamsMoreExactly) {
  const Seabed seabed = Seabed::slope(0.1, -0.05);
  const Errors errors = errorsOf(mapOf(seabed, 7200, {0.0, 0.0}), seabed);
  EXPECT_LT(errors.z_m, 0.002);  // the prior would have it level
  EXPECT_LT(errors.slope, 0.002);
}

TEST(LocalMap, HasTheSlopeOfItsOwnSurface) {
  const LocalMap map = mapOf(Seabed::relief(1.0, 2), 7200);
  // Single precision: depths of 80 m are rounded to 8e-6 m.
  constexpr float kStep_m = 0.02F;
  constexpr double kRounding = 1e-3;
  std::mt19937 random(3);
  std::uniform_real_distribution<float> uniform(-1.0F, 1.0F);
  int within = 0;
  for (int place = 0; place < 300; ++place) {
    const float x = 25.0F * uniform(random);
    const float y = 17.0F * uniform(random);
    const LocalMap::Look look = map.at(x, y);
    ASSERT_TRUE(look.known);
    const auto cell = [&](float x_m, float y_m) {
      return std::pair(std::floor(x_m / map.spacing_m()), std::floor(y_m / map.spacing_m()));
    };
    if (cell(x - kStep_m, y - kStep_m) != cell(x + kStep_m, y + kStep_m)) continue;
    ++within;
    const auto difference = [](const LocalMap::Look& a, const LocalMap::Look& b) {
      return (b.z_m - a.z_m) / (2.0F * kStep_m);
    };
    EXPECT_NEAR(look.slope_x, difference(map.at(x - kStep_m, y), map.at(x + kStep_m, y)),
                kRounding);
    EXPECT_NEAR(look.slope_y, difference(map.at(x, y - kStep_m), map.at(x, y + kStep_m)),
                kRounding);
  }
  EXPECT_GT(within, 200);
}

TEST(LocalMap, IsContinuousAcrossItsNodes) {
  const LocalMap map = mapOf(Seabed::relief(1.0, 2), 7200);
  const auto h = static_cast<float>(map.spacing_m());
  for (int k = -5; k <= 5; ++k) {
    const float edge = static_cast<float>(k) * h;
    EXPECT_NEAR(map.at(edge - 1e-4F, 3.3F).z_m, map.at(edge + 1e-4F, 3.3F).z_m, 2e-4) << k;
    EXPECT_NEAR(map.at(3.3F, edge - 1e-4F).z_m, map.at(3.3F, edge + 1e-4F).z_m, 2e-4) << k;
  }
}

TEST(LocalMap, KnowsNothingWhereNoBeamFell) {
  const Seabed seabed = Seabed::relief(1.0, 1);
  Beams beams = beamsAbout(seabed, {}, kLength_m, kWidth_m, 7200, 1);
  // A hole of 12 m by 40 m: beams are moved to one side of it.
  for (Eigen::Index b = 0; b < beams.cols(); ++b) {
    if (std::abs(beams(0, b)) < 6.0F) beams(0, b) -= 12.0F;
  }
  const LocalMap map(beams);
  const float cell = static_cast<float>(map.spacing_m());
  for (float y = -15.0F; y <= 15.0F; y += 1.0F) {
    for (float x = -6.0F + cell; x < 6.0F - cell; x += 0.5F) EXPECT_FALSE(map.at(x, y).known);
    EXPECT_TRUE(map.at(-6.0F - cell, y).known) << y;
    EXPECT_TRUE(map.at(6.0F + cell, y).known) << y;
  }
  for (const float far : {40.0F, 1e6F, 1e30F, std::numeric_limits<float>::infinity(), kNaN}) {
    EXPECT_FALSE(map.at(far, 0.0F).known) << far;
    EXPECT_FALSE(map.at(-far, 0.0F).known) << far;
    EXPECT_FALSE(map.at(10.0F, far).known) << far;
    EXPECT_FALSE(map.at(10.0F, -far).known) << far;
  }
}

TEST(LocalMap, OfNoBeamKnowsNothing) {
  const LocalMap map(Beams(3, 0));
  EXPECT_FALSE(map.at(0.0F, 0.0F).known);
  EXPECT_EQ(map.spacing_m(), 0.0);
}

TEST(LocalMap, OfOneBeamStandsIt) {
  Beams beam(3, 1);
  beam << 3.5F, -2.5F, -80.0F;
  const LocalMap map(beam);
  EXPECT_EQ(map.spacing_m(), 1.0);
  EXPECT_FALSE(map.at(10.0F, 0.0F).known);
}

TEST(LocalMap, HasTheBeamsNoise) {
  const Seabed seabed = Seabed::relief(0.5, 4);
  for (const double noise_std_m : {0.08, 0.15, 0.3}) {
    const LocalMap map = mapOf(seabed, 7200, {noise_std_m, 0.0});
    // A node for some eight beams takes a tenth of their variance; what lies between nodes adds.
    EXPECT_NEAR(map.noise_std_m() / noise_std_m, 1.0, 0.1) << noise_std_m;
  }
  EXPECT_EQ(mapOf(seabed, 7200, {0.01, 0.0}).noise_std_m(), 0.05) << "the least that is believed";
}

TEST(LocalMap, WeighsOutliersDown) {
  const Seabed seabed = Seabed::relief(1.0, 1);
  const Errors clean = errorsOf(mapOf(seabed, 7200), seabed);
  for (const double outliers : {0.05, 0.1}) {
    const LocalMap map = mapOf(seabed, 7200, {0.1, outliers});
    const Errors errors = errorsOf(map, seabed);
    // Within 5 m, of standard deviation 2.9 m; in means of eight beams one would be 0.3 m.
    EXPECT_LT(errors.z_m, 1.3 * clean.z_m) << outliers;
    EXPECT_LT(errors.slope, 1.4 * clean.slope) << outliers;
    EXPECT_NEAR(map.noise_std_m(), 0.1, 0.02) << outliers;
  }
}

TEST(LocalMap, HasSomeEightBeamsToANode) {
  const Seabed seabed = Seabed::relief(1.0, 1);
  for (const double beams_per_m2 : {2.0, 3.0, 6.0}) {
    const auto beams = static_cast<Eigen::Index>(beams_per_m2 * kLength_m * kWidth_m);
    const double expected_m = std::sqrt(8.0 / beams_per_m2);
    // Cells of 1 m without a beam do not count as surveyed: with two beams to a cell, one in seven.
    EXPECT_NEAR(mapOf(seabed, beams).spacing_m() / expected_m, 1.0, 0.1) << beams_per_m2;
  }
  EXPECT_EQ(mapOf(seabed, 40000).spacing_m(), 1.0) << "no finer";
}

TEST(LocalMap, OfSparseBeamsIsCoarseAndStillASurface) {
  const Seabed seabed = Seabed::relief(1.0, 1);
  const LocalMap map = mapOf(seabed, 600);  // one to 4 m^2
  EXPECT_NEAR(map.spacing_m(), std::sqrt(8.0 * 4.0), 0.2);
  const Errors errors = errorsOf(map, seabed);
  EXPECT_GT(errors.known, 0.98);
  // Waves of 12 m are not resolved, longer ones are: half the relief is the least it should have.
  EXPECT_LT(errors.z_m, 0.5);
}

// Depths of 80 m and places some kilometres from the origin, in single precision.
TEST(LocalMap, IsTheSameFarFromItsOrigin) {
  const Seabed seabed = Seabed::relief(1.0, 1);
  Beams beams = beamsAbout(seabed, {}, kLength_m, kWidth_m, 7200, 1);
  beams.row(0).array() += 8192.0F;
  beams.row(1).array() -= 4096.0F;
  const LocalMap map(beams);
  const LocalMap near = mapOf(seabed, 7200);
  EXPECT_NEAR(map.spacing_m(), near.spacing_m(), 0.01);
  double squares = 0.0;
  int places = 0;
  for (float x = -25.0F; x <= 25.0F; x += 1.3F) {
    for (float y = -17.0F; y <= 17.0F; y += 1.3F) {
      const LocalMap::Look look = map.at(x + 8192.0F, y - 4096.0F);
      ASSERT_TRUE(look.known);
      squares += std::pow(look.z_m - seabed.z_m(x, y), 2);
      ++places;
    }
  }
  EXPECT_LT(std::sqrt(squares / places), 0.05);  // as HasTheSeabedAndItsSlope
}

}  // namespace
}  // namespace rbpf_core::smoothing
