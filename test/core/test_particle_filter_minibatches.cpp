// Which beams the filter releases to the maps, and that no request for them disturbs another.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <set>
#include <stdexcept>
#include <thread>
#include <tuple>
#include <vector>

#include "rbpf_core/particle_filter.hpp"
#include "survey.hpp"

namespace rbpf_core {
namespace {

// A straight survey at 1 Hz; the beams of ping k lie k metres ahead, so that x tells the ping.
void sailMarked(ParticleFilter& filter, int from_s, int to_s) {
  for (int k = from_s; k < to_s; ++k) {
    filter.addOdometry(straight(k));
    filter.addPing(pingAt(k, 4, static_cast<float>(k)));
  }
}

// The pings that a large minibatch comes from: the vehicle is at 2 k metres, the beam k ahead.
std::set<int> pingsDrawnFrom(const ParticleFilter& filter) {
  std::set<int> pings;
  for (const PlacedBeam& beam : drawFrom(filter, 0, 20000)) {
    pings.insert(static_cast<int>(std::lround(beam.x_m / 3.0)));
  }
  return pings;
}

std::set<int> range(int first, int last) {
  std::set<int> numbers;
  for (int k = first; k <= last; ++k) numbers.insert(k);
  return numbers;
}

// ---- held back, held out -----------------------------------------------------------------------

TEST(HoldBack, ReleasesOnlyPingsThatAreOldEnough) {
  FilterParams params = quietParams();
  params.hold_back_s = 30.0;
  ParticleFilter filter(params);
  sailMarked(filter, 0, 30);  // the odometry has come to 29 s
  PlacedBeam beam;
  EXPECT_EQ(filter.snapshot().drawMinibatch(0, 1, &beam), 0U);
  EXPECT_EQ(filter.snapshot().beams(), 120U);
  sailMarked(filter, 30, 31);
  EXPECT_EQ(filter.snapshot().drawMinibatch(0, 1, &beam), 4U);
  EXPECT_EQ(pingsDrawnFrom(filter), range(0, 0));
  sailMarked(filter, 31, 100);
  EXPECT_EQ(filter.snapshot().drawMinibatch(0, 1, &beam), 280U);
  EXPECT_EQ(pingsDrawnFrom(filter), range(0, 69));
}

TEST(HoldBack, EndsWithTheSurvey) {
  FilterParams params = quietParams();
  params.hold_back_s = 30.0;
  ParticleFilter filter(params);
  sailMarked(filter, 0, 100);
  filter.finish();
  EXPECT_EQ(pingsDrawnFrom(filter), range(0, 99));
}

TEST(HoldBack, OfZeroReleasesEverythingAtOnce) {
  ParticleFilter filter(quietParams());
  sailMarked(filter, 0, 20);
  EXPECT_EQ(pingsDrawnFrom(filter), range(0, 19));
}

TEST(HoldBack, DoesNotReleaseAPingEarlyBecauseItCameLate) {
  FilterParams params = quietParams();
  params.hold_back_s = 5.0;
  ParticleFilter filter(params);
  for (int k = 0; k <= 9; ++k) filter.addOdometry(straight(k));
  filter.addPing(pingAt(8.0, 4, 8.0F));
  filter.addPing(pingAt(2.0, 4, 2.0F));  // old enough, but behind a ping that is not
  PlacedBeam beam;
  EXPECT_EQ(filter.snapshot().drawMinibatch(0, 1, &beam), 0U);
  for (int k = 10; k <= 13; ++k) filter.addOdometry(straight(k));
  EXPECT_EQ(pingsDrawnFrom(filter), (std::set<int>{2, 8}));
}

TEST(Holdout, NeverReleasesItsShareOfThePings) {
  for (const double share : {0.02, 0.1, 0.25, 0.5}) {
    FilterParams params = quietParams();
    params.holdout = share;
    ParticleFilter filter(params);
    sailMarked(filter, 0, 200);
    filter.finish();
    std::set<int> released;
    for (const SurveyPing& ping : filter.snapshot().survey(0, 200)) {
      if (!ping.record.held_out) released.insert(static_cast<int>(ping.record.stamp_s));
    }
    // floor of 200 share, give or take the rounding of the share
    EXPECT_NEAR(static_cast<double>(200 - released.size()), 200.0 * share, 1.0) << share;
    EXPECT_EQ(pingsDrawnFrom(filter), released) << share;
    EXPECT_EQ(filter.snapshot().beams(), 4 * released.size());
    EXPECT_EQ(filter.snapshot().beams() + filter.snapshot().beamsHeldOut(), 800U);
  }
}

TEST(Holdout, OfZeroHoldsNothingOut) {
  ParticleFilter filter(quietParams());
  sailMarked(filter, 0, 200);
  EXPECT_EQ(filter.snapshot().beamsHeldOut(), 0U);
}

TEST(Minibatch, CountsFromTheSurveysOrigin) {
  FilterParams params = quietParams();
  params.start_pose = Pose2{5e6, -4e6, 0.0};
  params.origin = {5e6 + 100.0, -4e6 - 50.0};
  ParticleFilter filter(params);
  sailMarked(filter, 0, 50);
  for (const PlacedBeam& beam : drawFrom(filter, 0, 1000)) {
    const double ping = std::round((beam.x_m + 100.0) / 3.0);
    EXPECT_NEAR(beam.x_m, 3.0 * ping - 100.0, 1e-3);
    EXPECT_NEAR(beam.y_m, 50.0 + std::round(beam.y_m - 50.0), 1e-3);
    EXPECT_EQ(beam.z_m, -30.0F);
  }
}

TEST(Minibatch, OfAParticleThatDoesNotExistIsRefused) {
  ParticleFilter filter(quietParams(3));
  sailMarked(filter, 0, 5);
  PlacedBeam beam;
  EXPECT_THROW(filter.snapshot().drawMinibatch(3, 1, &beam), std::out_of_range);
}

// ---- the log in its order ----------------------------------------------------------------------

TEST(Block, HoldsTheLogInItsOrder) {
  ParticleFilter filter(quietParams());
  sailMarked(filter, 0, 50);
  const std::vector<PlacedBeam> log = blockFrom(filter, 1, 0, 200);
  for (std::size_t i = 0; i < log.size(); ++i) {
    EXPECT_EQ(std::lround(log[i].x_m / 3.0), static_cast<long>(i / 4));
    EXPECT_EQ(std::lround(log[i].y_m), static_cast<long>(i % 4));
  }
}

TEST(Block, IsPlacedByTheHistoryThatTheParticleHasNow) {
  ParticleFilter filter(noisyParams(3));
  sail(filter, turning, 0, 30);
  const std::size_t beams = filter.snapshot().beamsReleased();
  const std::vector<PlacedBeam> of_two = blockFrom(filter, 2, 0, beams);
  EXPECT_FALSE(blockFrom(filter, 0, 0, beams) == of_two);
  filter.resample({2, 1, 0});
  sail(filter, turning, 30, 40);
  EXPECT_TRUE(blockFrom(filter, 0, 0, beams) == of_two);
}

TEST(Block, LeavesOutWhatIsHeldOutAndRefusesWhatIsHeldBack) {
  FilterParams params = quietParams();
  params.hold_back_s = 30.0;
  params.holdout = 0.5;  // every second ping, the first one not
  ParticleFilter filter(params);
  sailMarked(filter, 0, 100);
  const std::size_t released = filter.snapshot().beamsReleased();
  EXPECT_EQ(released, 4U * 35);  // pings 0, 2 .. 68 of 0 .. 69
  const std::vector<PlacedBeam> log = blockFrom(filter, 0, 0, released);
  for (std::size_t i = 0; i < log.size(); ++i) {
    EXPECT_EQ(std::lround(log[i].x_m / 3.0), static_cast<long>(i / 4 * 2));
  }
  EXPECT_TRUE(blockFrom(filter, 0, released, 0).empty());
  EXPECT_THROW(blockFrom(filter, 0, released, 1), std::out_of_range);
  EXPECT_THROW(blockFrom(filter, 0, released - 3, 4), std::out_of_range);
  EXPECT_THROW(blockFrom(filter, 0, released + 1, 0), std::out_of_range);
}

TEST(Block, OfAParticleThatDoesNotExistIsRefused) {
  ParticleFilter filter(quietParams(3));
  sailMarked(filter, 0, 5);
  EXPECT_THROW(blockFrom(filter, 3, 0, 1), std::out_of_range);
}

TEST(Block, DoesNotDisturbTheMinibatches) {
  ParticleFilter asked(noisyParams());
  ParticleFilter left_alone(noisyParams());
  sail(asked, turning, 0, 30);
  sail(left_alone, turning, 0, 30);
  blockFrom(asked, 1, 0, 10);
  EXPECT_TRUE(drawFrom(asked, 1, 100) == drawFrom(left_alone, 1, 100));
}

// ---- requests in any order and number ----------------------------------------------------------

using Batch = std::vector<PlacedBeam>;

bool operator<(const PlacedBeam& a, const PlacedBeam& b) {
  return std::tie(a.x_m, a.y_m, a.z_m) < std::tie(b.x_m, b.y_m, b.z_m);
}

bool earlier(const Batch& a, const Batch& b) {
  return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end(),
                                      [](const auto& p, const auto& q) { return p < q; });
}

TEST(Minibatches, DifferFromCallToCall) {
  ParticleFilter filter(quietParams());
  sail(filter, turning, 0, 30);
  EXPECT_FALSE(drawFrom(filter, 0, 50) == drawFrom(filter, 0, 50));
}

TEST(Minibatches, DifferFromParticleToParticleThoughTheHistoriesAreTheSame) {
  ParticleFilter filter(quietParams());
  sail(filter, turning, 0, 30);
  EXPECT_FALSE(drawFrom(filter, 0, 50) == drawFrom(filter, 1, 50));
}

TEST(Minibatches, OfAParticleDoNotDependOnTheOthersCalls) {
  ParticleFilter in_turns(noisyParams(3));
  ParticleFilter one_by_one(noisyParams(3));
  sail(in_turns, turning, 0, 30);
  sail(one_by_one, turning, 0, 30);
  std::vector<std::vector<Batch>> a(3), b(3);
  for (int call = 0; call < 5; ++call) {
    for (const std::size_t j : {2U, 0U, 1U}) a[j].push_back(drawFrom(in_turns, j, 100));
  }
  for (std::size_t j = 0; j < 3; ++j) {
    for (int call = 0; call < 5; ++call) b[j].push_back(drawFrom(one_by_one, j, 100));
  }
  EXPECT_TRUE(a == b);
}

TEST(Minibatches, DoNotMoveTheParticles) {
  ParticleFilter asked(noisyParams());
  ParticleFilter left_alone(noisyParams());
  for (int k = 0; k < 20; ++k) {
    sail(asked, turning, k, k + 1);
    sail(left_alone, turning, k, k + 1);
    drawFrom(asked, static_cast<std::size_t>(k % 5), 77);
  }
  EXPECT_EQ(asked.snapshot().particles(), left_alone.snapshot().particles());
}

// Four threads on one particle: together they get what one alone would have got, call by call.
TEST(Minibatches, AreTheSameFromManyThreadsAsFromOne) {
  constexpr int kThreads = 4;
  constexpr int kCalls = 5000;
  ParticleFilter shared(noisyParams());
  ParticleFilter alone(noisyParams());
  sail(shared, turning, 0, 30);
  sail(alone, turning, 0, 30);
  std::vector<std::vector<Batch>> of_thread(kThreads);
  std::atomic<int> started{0};
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      auto& batches = of_thread[static_cast<std::size_t>(t)];
      ++started;
      while (started < kThreads) std::this_thread::yield();
      for (int call = 0; call < kCalls; ++call) batches.push_back(drawFrom(shared, 2, 4));
    });
  }
  for (std::thread& thread : threads) thread.join();
  std::vector<Batch> seen, expected;
  for (auto& batches : of_thread) seen.insert(seen.end(), batches.begin(), batches.end());
  for (int call = 0; call < kThreads * kCalls; ++call) expected.push_back(drawFrom(alone, 2, 4));
  std::sort(seen.begin(), seen.end(), earlier);
  std::sort(expected.begin(), expected.end(), earlier);
  EXPECT_TRUE(seen == expected);
}

}  // namespace
}  // namespace rbpf_core
