// Motions of the past, of which only some are told.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "rbpf_core/past_correction.hpp"

namespace rbpf_core {
namespace {

struct Past {
  std::vector<Pose2> poses;
  std::vector<Pose2> motions;
};

// Along x, from far away; moved where(ping) says so, by what changes gently.
template <typename Where>
Past moved(std::size_t pings, const Where& where) {
  Past past;
  for (std::size_t i = 0; i < pings; ++i) {
    const auto t = static_cast<double>(i);
    past.poses.push_back({0.4 * t, 500.0, 0.1 * std::sin(0.01 * t)});
    const double x = 2e-3 * t;
    past.motions.push_back(
        where(i) ? Pose2{0.3 * std::sin(x), 0.2 * std::cos(x), 1e-4 * std::sin(x)} : Pose2{});
  }
  return past;
}

std::size_t toldOf(const Past& past, const MotionTolerance& tolerance = {1e-3, 1e-5}) {
  const std::vector<PingMotion> told = thinned(past.motions, past.poses, tolerance);
  const std::vector<Pose2> made = motionOfEach(told);
  EXPECT_EQ(made.size(), past.motions.size());
  for (std::size_t i = 0; i < made.size(); ++i) {
    const Pose2 to = move(past.motions[i], past.poses[i]);
    const Pose2 taken = move(made[i], past.poses[i]);
    EXPECT_TRUE(tolerance.holds(taken, to)) << i;
  }
  return told.size();
}

TEST(ThinnedMotions, TakeEveryPoseToItsPlaceWithinTheTolerance) {
  EXPECT_EQ(toldOf({}), 0U);
  for (const std::size_t pings : {1U, 2U, 3U, 1000U}) {
    toldOf(moved(pings, [](std::size_t) { return true; }));
    // in steps
    toldOf(moved(pings, [](std::size_t i) { return i % 100 > 30; }));
  }
  std::mt19937 random(1);
  std::normal_distribution<double> normal(0.0, 0.1);
  Past rough = moved(500, [](std::size_t) { return true; });
  for (Pose2& motion : rough.motions) motion.x_m += normal(random);
  EXPECT_GT(toldOf(rough), 400U);  // nothing can be left out
  const Past gentle = moved(500, [](std::size_t) { return true; });
  EXPECT_EQ(toldOf(gentle, {}), 500U);
}

// What it takes is the work of where the past has moved, not of how long it is.
TEST(ThinnedMotions, AreFewWhereThePastStaysOrMovesGently) {
  EXPECT_LE(toldOf(moved(100'000, [](std::size_t) { return false; })), 2U);
  EXPECT_LT(toldOf(moved(20'000, [](std::size_t) { return true; })), 20'000U / 50);
  const std::size_t last_few = toldOf(moved(100'000, [](std::size_t i) { return i >= 99'800; }));
  EXPECT_LT(last_few, 60U);
}

}  // namespace
}  // namespace rbpf_core
