#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "rbpf_core/ping_filter.hpp"
#include "rbpf_core/random.hpp"

namespace rbpf_core {
namespace {

constexpr float kNoNumber = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfiniteFloat = std::numeric_limits<float>::infinity();

// A swath of beams 0.5 m apart across the track, with a depth that depends on y.
Ping swath(int beams, const std::function<double(double)>& depth_m) {
  Ping ping;
  ping.beams_m.resize(3, beams);
  for (int i = 0; i < beams; ++i) {
    const double y_m = 0.5 * (0.5 * (beams - 1) - i);
    ping.beams_m.col(i) << 0.0F, static_cast<float>(y_m), static_cast<float>(depth_m(y_m));
  }
  return ping;
}

Ping flatSwath(int beams) {
  return swath(beams, [](double) { return -20.0; });
}

PingFilterParams rangesOnly(double min_range_m, double max_range_m) {
  PingFilterParams params;
  params.min_range_m = min_range_m;
  params.max_range_m = max_range_m;
  params.outlier_window = 0;
  return params;
}

PingFilterParams outlierFilter(int window = 9,
                               double threshold = PingFilterParams().outlier_threshold) {
  PingFilterParams params;
  params.outlier_window = window;
  params.outlier_threshold = threshold;
  return params;
}

// The numbers of the beams that were kept; beams are told apart by their y.
std::vector<int> keptOf(const Ping& ping, const PingFilterParams& params = outlierFilter()) {
  const Beams good = goodBeams(ping, {}, params);
  std::vector<int> kept;
  for (Eigen::Index k = 0; k < good.cols(); ++k) {
    for (int i = 0; i < ping.beams_m.cols(); ++i) {
      if (ping.beams_m.col(i) == good.col(k)) kept.push_back(i);
    }
  }
  return kept;
}

std::vector<int> allBut(int beams, const std::vector<int>& missing) {
  std::vector<int> kept;
  for (int i = 0; i < beams; ++i) {
    if (std::find(missing.begin(), missing.end(), i) == missing.end()) kept.push_back(i);
  }
  return kept;
}

// Uniform noise of +- half_width.
Ping withNoise(Ping ping, double half_width_m, std::uint64_t seed) {
  RandomStream stream(seed);
  for (float& z : ping.beams_m.row(2)) {
    z += static_cast<float>(2.0 * half_width_m * (stream.uniform() - 0.5));
  }
  return ping;
}

// ---- levelling -------------------------------------------------------------------------------

TEST(LevelBeams, TurnsByRollThenPitchAndAddsTheVehiclesDepth) {
  const Attitude attitude{-50.0, 0.2, -0.3};
  Beams beams(3, 2);
  beams << 1.0F, -4.0F, 2.0F, 5.0F, -20.0F, -30.0F;
  const Beams levelled = levelBeams(beams, attitude);
  for (Eigen::Index i = 0; i < 2; ++i) {
    const double x = beams(0, i);
    const double y = beams(1, i);
    const double z = beams(2, i);
    const double up = y * std::sin(0.2) + z * std::cos(0.2);
    // 1e-5 m: float32 at 80 m
    EXPECT_NEAR(levelled(0, i), x * std::cos(-0.3) + up * std::sin(-0.3), 1e-5);
    EXPECT_NEAR(levelled(1, i), y * std::cos(0.2) - z * std::sin(0.2), 1e-5);
    EXPECT_NEAR(levelled(2, i), -50.0 - x * std::sin(-0.3) + up * std::cos(-0.3), 1e-5);
  }
}

TEST(LevelBeams, PutsTheSeabedOfARollingAndPitchingVehicleBackWhereItIs) {
  const Attitude attitude{-8.0, -0.15, 0.2};
  const Eigen::Vector3d seabed(3.0, -7.0, -30.0);  // levelled frame, z in map
  const Eigen::Matrix3d R = (Eigen::AngleAxisd(attitude.pitch_rad, Eigen::Vector3d::UnitY()) *
                             Eigen::AngleAxisd(attitude.roll_rad, Eigen::Vector3d::UnitX()))
                                .toRotationMatrix();
  const Eigen::Vector3d body = R.transpose() * (seabed - Eigen::Vector3d(0.0, 0.0, attitude.z_m));
  const Beams beams = body.cast<float>();
  EXPECT_TRUE(levelBeams(beams, attitude).isApprox(Beams(seabed.cast<float>()), 1e-6F));
}

TEST(LevelBeams, LeavesNaN) {
  Beams beams(3, 2);
  beams << kNoNumber, 1.0F, kNoNumber, 1.0F, kNoNumber, 1.0F;
  const Beams levelled = levelBeams(beams, {-10.0, 0.1, 0.1});
  EXPECT_TRUE(levelled.col(0).array().isNaN().all());
  EXPECT_TRUE(levelled.col(1).allFinite());
}

// ---- ranges ----------------------------------------------------------------------------------

TEST(GoodBeams, RefusesWhatIsNotFinite) {
  Ping ping = flatSwath(20);
  ping.beams_m(0, 0) = kNoNumber;
  ping.beams_m(1, 5) = kNoNumber;
  ping.beams_m(2, 6) = kNoNumber;
  ping.beams_m(2, 10) = kInfiniteFloat;
  ping.beams_m(1, 19) = -kInfiniteFloat;
  EXPECT_EQ(keptOf(ping), allBut(20, {0, 5, 6, 10, 19}));
}

TEST(GoodBeams, RefusesRangesOutsideTheGate) {
  Ping ping;
  ping.beams_m.resize(3, 5);
  ping.beams_m.setZero();
  ping.beams_m.row(2) << -0.25F, -0.5F, -30.0F, -64.0F, -64.5F;
  EXPECT_EQ(keptOf(ping, rangesOnly(0.5, 64.0)), (std::vector<int>{1, 2, 3}));
}

TEST(GoodBeams, CountsTheRangeFromTheSensor) {
  Ping ping;
  ping.sensor_m << 3.0F, 0.0F, -1.0F;
  ping.beams_m.resize(3, 2);
  ping.beams_m << 3.0F, 0.0F, 0.0F, 0.0F, -1.25F, -1.25F;  // 0.25 m and 3.01 m from the sensor
  EXPECT_EQ(keptOf(ping, rangesOnly(0.5, 64.0)), (std::vector<int>{1}));
  EXPECT_EQ(keptOf(ping, rangesOnly(0.0, 3.0)), (std::vector<int>{0}));
}

TEST(GoodBeams, OfAnEmptyPingAreNone) {
  EXPECT_EQ(goodBeams(Ping(), {}, {}).cols(), 0);
  Ping blind = flatSwath(30);
  blind.beams_m.setConstant(kNoNumber);
  EXPECT_EQ(goodBeams(blind, {}, {}).cols(), 0);
}

// ---- outliers --------------------------------------------------------------------------------

TEST(GoodBeams, RefusesSpikesAndKeepsTheOrderOfTheRest) {
  Ping ping = swath(101, [](double y) { return -20.0 + 0.1 * std::sin(y); });
  for (const int spike : {20, 21, 60}) ping.beams_m(2, spike) += 3.0F;
  ping.beams_m(2, 80) -= 3.0F;
  EXPECT_EQ(keptOf(ping), allBut(101, {20, 21, 60, 80}));
}

TEST(GoodBeams, RefusesSpikesAtTheSwathsEnds) {
  Ping ping = flatSwath(101);
  ping.beams_m(2, 0) += 5.0F;
  ping.beams_m(2, 100) -= 5.0F;
  EXPECT_EQ(keptOf(ping), allBut(101, {0, 100}));
}

// On a slope the outer beams have neighbours on one side only.
TEST(GoodBeams, KeepsEveryBeamOfASteepSlope) {
  for (const double slope : {0.5, -0.5, 1.0, 2.0}) {
    const Ping ping = swath(101, [&](double y) { return -60.0 + slope * y; });
    EXPECT_EQ(keptOf(ping), allBut(101, {})) << "slope " << slope;
  }
}

TEST(GoodBeams, RefusesSpikesOnASteepSlope) {
  Ping ping = swath(101, [](double y) { return -60.0 + y; });
  ping.beams_m(2, 30) += 5.0F;
  ping.beams_m(2, 50) -= 5.0F;
  EXPECT_EQ(keptOf(ping), allBut(101, {30, 50}));
}

TEST(GoodBeams, KeepsBothSidesOfACliff) {
  const Ping ping = swath(100, [](double y) { return y > 0.0 ? -20.0 : -28.0; });
  EXPECT_EQ(keptOf(ping), allBut(100, {}));
}

TEST(GoodBeams, DoesNotCallCentimetresOnFlatSeabedOutliers) {
  Ping ping = flatSwath(101);
  // most beams agree to the millimetre, some are 20 cm off: within 8 x the least deviation of 5 cm
  for (int i = 0; i < 101; i += 10) ping.beams_m(2, i) += 0.2F;
  EXPECT_EQ(keptOf(ping), allBut(101, {}));
}

TEST(GoodBeams, MeasuresOutliersInThePingsOwnNoise) {
  Ping noisy = withNoise(flatSwath(201), 1.0, 1);
  noisy.beams_m(2, 100) = -20.0F + 2.0F;  // would be an outlier on a quiet ping
  EXPECT_EQ(keptOf(noisy, outlierFilter(9, 8.0)), allBut(201, {}));
  const std::vector<int> kept = keptOf(noisy, outlierFilter(9, 1.5));
  EXPECT_EQ(std::count(kept.begin(), kept.end(), 100), 0);
}

TEST(GoodBeams, RefusesHardlyAnyBeamOfANoisySlope) {
  const Ping slope = swath(256, [](double y) { return -60.0 + 0.5 * y; });
  Eigen::Index refused = 0;
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const Ping ping = withNoise(slope, 0.6, seed);
    refused += 256 - goodBeams(ping, {}, outlierFilter()).cols();
  }
  // of 51,200 beams; noise that ends at two standard deviations holds no outlier
  EXPECT_LT(refused, 20);
}

TEST(GoodBeams, ComparesDepthsAfterLevelling) {
  // flat seabed seen at 0.6 rad of roll, where a step aside is a step in the body frame's z
  const Attitude attitude{0.0, 0.6, 0.0};
  Ping ping = flatSwath(101);
  ping.beams_m(2, 40) += 2.0F;  // a spike
  ping.beams_m(1, 70) += 3.0F;  // none: it hits the same flat seabed, further aside
  const Eigen::AngleAxisf back(-0.6F, Eigen::Vector3f::UnitX());
  ping.beams_m = (back.toRotationMatrix() * ping.beams_m).eval();
  const Beams good = goodBeams(ping, attitude, outlierFilter());
  EXPECT_EQ(good.cols(), 100);
  EXPECT_LT((good.row(2).array() + 20.0F).abs().maxCoeff(), 1e-4F);  // float32 at 30 m
}

TEST(GoodBeams, LeavesPingsThatAreShorterThanTheWindowAlone) {
  Ping ping = flatSwath(8);
  ping.beams_m(2, 3) += 3.0F;
  EXPECT_EQ(keptOf(ping, outlierFilter(9)), allBut(8, {}));
  EXPECT_EQ(keptOf(ping, outlierFilter(7)), allBut(8, {3}));
  EXPECT_EQ(keptOf(flatSwath(100), outlierFilter(1001)), allBut(100, {}));
}

TEST(GoodBeams, FindsTheSpikeInTheShortestPingThatFillsItsWindow) {
  for (const int window : {9, 21}) {
    for (int spike = 0; spike < window; ++spike) {
      Ping ping = flatSwath(window);
      ping.beams_m(2, spike) += 10.0F;
      EXPECT_EQ(keptOf(ping, outlierFilter(window)), allBut(window, {spike})) << window;
    }
  }
}

TEST(GoodBeams, CanDoWithoutTheOutlierFilter) {
  Ping ping = flatSwath(101);
  ping.beams_m(2, 50) += 10.0F;
  EXPECT_EQ(keptOf(ping, rangesOnly(0.5, 500.0)), allBut(101, {}));
}

TEST(PlacedBeams, AreTakenBackToTheVehicleThatPlacedThem) {
  Odometry odometry;
  odometry.pose = {100.0, -50.0, 2.0};
  odometry.attitude = {-20.0, 0.1, -0.2};
  Ping ping;
  ping.beams_m.resize(3, 2);
  ping.beams_m << 0.5F, -1.0F, 3.0F, -4.0F, -15.0F, -16.0F;
  // R = Rz(yaw) Ry(pitch) Rx(roll), and the vehicle's place
  const Eigen::Matrix3d R = (Eigen::AngleAxisd(2.0, Eigen::Vector3d::UnitZ()) *
                             Eigen::AngleAxisd(-0.2, Eigen::Vector3d::UnitY()) *
                             Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX()))
                                .toRotationMatrix();
  Ping placed = ping;
  placed.in_odometry_frame = true;
  placed.beams_m =
      ((R * ping.beams_m.cast<double>()).colwise() + Eigen::Vector3d(100.0, -50.0, -20.0))
          .cast<float>();
  const Ping own = inBaseLink(placed, odometry);
  EXPECT_FALSE(own.in_odometry_frame);
  // float32 at 100 m: 8e-6 m a rounding
  EXPECT_LT((own.beams_m - ping.beams_m).cwiseAbs().maxCoeff(), 5e-5F);
}

}  // namespace
}  // namespace rbpf_core
