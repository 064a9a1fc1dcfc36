// The filter when its past is corrected.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "rbpf_core/particle_filter.hpp"
#include "survey.hpp"

namespace rbpf_core {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

std::string problemWithCorrection(ParticleFilter& filter, const PastCorrection& correction) {
  try {
    filter.correctPast(correction);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(ParticleFilterCorrections, MoveEveryPingAndTheParticlesNow) {
  ParticleFilter filter(noisyParams(4));
  sail(filter, turning, 0, 20);
  filter.resample({2, 2, 0, 3});
  sail(filter, turning, 20, 40);
  const FilterSnapshot before = filter.snapshot();
  // between some of them interpolated
  const auto motionOf = [](std::size_t ping) {
    const auto share = static_cast<double>(ping);
    return Pose2{0.1 * share, -0.2 * share, 0.01 * share};
  };
  const std::size_t told = before.pings() - 5;
  PastCorrection correction;
  for (const std::size_t i : {std::size_t{0}, std::size_t{1}, told / 2, told - 1}) {
    correction.of_pings.push_back({i, motionOf(i)});
  }
  correction.of_rest = {7.0, -3.0, 0.5};
  filter.correctPast(correction);
  const FilterSnapshot after = filter.snapshot();

  ASSERT_EQ(after.pings(), before.pings());
  for (std::size_t i = 0; i < before.pings(); ++i) {
    const Pose2 motion = i < told ? motionOf(i) : correction.of_rest;
    const SurveyPing was = before.survey(i, 1)[0];
    // the mean moves with the particles; yaws were kept as float32
    expectNear(after.survey(i, 1)[0].estimate, move(motion, was.estimate), 2e-6);
    EXPECT_EQ(after.record(i).dead_reckoning, was.record.dead_reckoning);
  }
  for (std::size_t j = 0; j < 4; ++j) {
    EXPECT_EQ(after.particles()[j], move(correction.of_rest, before.particles()[j]));
  }
  EXPECT_EQ(after.estimate().odometry, before.estimate().odometry);
  EXPECT_EQ(after.estimate().dead_reckoning, before.estimate().dead_reckoning);
}

TEST(ParticleFilterCorrections, AreCountedInTheSnapshotsThatShowThem) {
  ParticleFilter filter(noisyParams(3));
  sail(filter, turning, 0, 20);
  const FilterSnapshot before = filter.snapshot();
  const Pose2 was = before.latestPing()->poses[1];
  PastCorrection correction;
  correction.of_rest = {1.0, 0.0, 0.0};
  correction.bias = {0.1, 0.2, 0.3};
  filter.correctPast(correction);
  filter.resample({1, 1, 1});
  EXPECT_EQ(before.past(), 0U);
  EXPECT_EQ(before.latestPing()->poses[1], was);
  EXPECT_EQ(filter.snapshot().past(), 1U);
  EXPECT_EQ(filter.snapshot().bias().sway_mps, 0.2);
  filter.correctPast({});
  EXPECT_EQ(filter.snapshot().past(), 2U);
  EXPECT_EQ(filter.snapshot().bias().sway_mps, 0.0);  // the newest bias replaces the one before it
}

// A late ping lies between poses that have been moved, and so does one that waits for odometry.
TEST(ParticleFilterCorrections, HoldForPingsOfTheTimeBeforeThatComeLater) {
  ParticleFilter corrected(noisyParams(3));
  ParticleFilter other(noisyParams(3));
  const PastCorrection correction{{}, {7.0, -3.0, 0.5}, {}};
  for (ParticleFilter* filter : {&corrected, &other}) {
    sail(*filter, turning, 0, 20);
    filter->addPing(pingAt(19.95));
  }
  corrected.correctPast(correction);
  for (ParticleFilter* filter : {&corrected, &other}) {
    filter->addPing(pingAt(18.03));
    EXPECT_EQ(filter->snapshot().latestPing()->stamp_s, 18.03);
  }
  const std::vector<Pose2> was = other.snapshot().latestPing()->poses;
  for (std::size_t j = 0; j < 3; ++j) {
    expectNear(corrected.snapshot().latestPing()->poses[j], move(correction.of_rest, was[j]), 1e-6);
  }
  for (ParticleFilter* filter : {&corrected, &other}) filter->addOdometry(turning(20.0));
  const std::vector<Pose2> later = other.snapshot().latestPing()->poses;
  for (std::size_t j = 0; j < 3; ++j) {
    // noise and motion are the same, seen from the moved pose
    expectNear(corrected.snapshot().latestPing()->poses[j], move(correction.of_rest, later[j]),
               1e-6);
  }
}

// Odometry that measures too much by the bias, and a bias that is known.
TEST(ParticleFilterCorrections, TakeTheBiasOffTheParticlesMotionOnly) {
  ParticleFilter filter(quietParams());
  const MotionBias bias{0.5, -0.2, 0.03};
  const auto biased = [&](double stamp_s) {
    Odometry odometry = turning(stamp_s);
    odometry.linear_mps += Eigen::Vector3d(bias.surge_mps, bias.sway_mps, 0.0);
    odometry.angular_radps.z() += bias.yaw_radps;
    return odometry;
  };
  ParticleFilter truth(quietParams());
  ParticleFilter uncorrected(quietParams());
  filter.addOdometry(biased(0.0));
  truth.addOdometry(turning(0.0));
  uncorrected.addOdometry(biased(0.0));
  filter.correctPast({{}, {}, bias});
  for (int k = 1; k < 100; ++k) {
    filter.addOdometry(biased(0.2 * k));
    truth.addOdometry(turning(0.2 * k));
    uncorrected.addOdometry(biased(0.2 * k));
  }
  expectNear(filter.snapshot().particles()[0], truth.snapshot().particles()[0], 1e-9);
  EXPECT_EQ(filter.snapshot().estimate().dead_reckoning,
            uncorrected.snapshot().estimate().dead_reckoning);
  EXPECT_GT(std::abs(filter.snapshot().estimate().dead_reckoning.x_m -
                     truth.snapshot().particles()[0].x_m),
            1.0);
}

// Whatever way the vehicle heads, the water carries it along.
TEST(ParticleFilterCorrections, CarryTheParticlesWithTheCurrent) {
  ParticleFilter filter(quietParams());
  ParticleFilter still(quietParams());
  for (ParticleFilter* each : {&filter, &still}) each->addOdometry(turning(0.0));
  PastCorrection correction;
  correction.bias.current_x_mps = 0.3;
  correction.bias.current_y_mps = -0.2;
  filter.correctPast(correction);
  for (int k = 1; k < 100; ++k) {
    for (ParticleFilter* each : {&filter, &still}) each->addOdometry(turning(0.2 * k));
  }
  Pose2 expected = still.snapshot().particles()[0];
  expected.x_m += 0.3 * 19.8;
  expected.y_m -= 0.2 * 19.8;
  expectNear(filter.snapshot().particles()[0], expected, 1e-9);
  EXPECT_EQ(filter.snapshot().estimate().dead_reckoning,
            still.snapshot().estimate().dead_reckoning);
}

TEST(ParticleFilterCorrections, AreRefusedWithAReasonAndWithoutEffect) {
  ParticleFilter filter(noisyParams(3));
  sail(filter, turning, 0, 5);
  const std::size_t pings = filter.snapshot().pings();
  const std::vector<Pose2> particles = filter.snapshot().particles();
  EXPECT_EQ(problemWithCorrection(filter, {{{0, {}}, {pings, {}}}, {}, {}}),
            "correction up to ping " + std::to_string(pings) + ", expected one of the " +
                std::to_string(pings) + " in the log");
  EXPECT_EQ(problemWithCorrection(filter, {{{1, {}}}, {}, {}}),
            "correction of the past: a motion of ping 1, expected ping 0 first");
  EXPECT_EQ(problemWithCorrection(filter, {{{0, {}}, {2, {}}, {2, {}}}, {}, {}}),
            "correction of the past: a motion of ping 2, expected one after ping 2");
  EXPECT_NE(problemWithCorrection(filter, {{{0, {}}, {1, {0.0, 0.0, kNaN}}}, {}, {}})
                .find("of ping 1 is (0"),
            std::string::npos);
  EXPECT_NE(problemWithCorrection(filter, {{}, {kNaN, 0.0, 0.0}, {}}).find("of the rest"),
            std::string::npos);
  EXPECT_NE(problemWithCorrection(filter, {{}, {1.0, 0.0, 0.0}, {0.0, kNaN, 0.0}}).find("the bias"),
            std::string::npos);
  EXPECT_EQ(filter.snapshot().past(), 0U);
  EXPECT_EQ(filter.snapshot().particles(), particles);
}

TEST(ParticleFilterCorrections, MayComeBeforeAnyOdometry) {
  ParticleFilter filter(quietParams());
  filter.correctPast({{}, {1.0, 0.0, 0.0}, {}});
  sail(filter, turning, 0, 5);
  EXPECT_EQ(filter.snapshot().past(), 1U);
  EXPECT_EQ(filter.snapshot().latestPing()->poses[0].x_m,
            filter.snapshot().latestPing()->poses[1].x_m);
}

// ---- while the survey goes on ------------------------------------------------------------------

// Every correction shifts all that there is by 1 m: a snapshot of past k shows every ping shifted
// by k, at whatever moment it is taken. Meant for ThreadSanitizer too.
TEST(ParticleFilterCorrections, AreWholeInEverySnapshot) {
  constexpr double kEast_m = 1.0;
  FilterParams params = quietParams(4);
  ParticleFilter filter(params);
  const auto still = [](double stamp_s) {
    Odometry odometry;
    odometry.stamp_s = stamp_s;
    odometry.linear_mps.z() = 1e-9;  // a twist, though one that moves nothing in the plane
    return odometry;
  };
  sail(filter, still, 0, 20);
  std::atomic<bool> stop{false};
  std::atomic<bool> sound{true};
  std::atomic<std::size_t> read{0};
  std::vector<std::thread> readers;
  for (int t = 0; t < 2; ++t) {
    readers.emplace_back([&] {
      for (; !stop; ++read) {
        const FilterSnapshot seen = filter.snapshot();
        const double east_m = kEast_m * seen.past();
        for (const Pose2& pose : seen.particles()) {
          if (pose.x_m != east_m) sound = false;
        }
        const LogBlock block = seen.logBlock({0, 3}, 0, seen.beamsReleased());
        for (const HistoryPose& pose : block.poses) {
          if (pose.x_m != east_m) sound = false;
        }
        std::vector<PlacedBeam> beams(50);
        seen.drawMinibatch(1, beams.size(), beams.data());
        for (const PlacedBeam& beam : beams) {
          if (beam.x_m != static_cast<float>(east_m)) sound = false;
        }
      }
    });
  }
  std::atomic<std::size_t> corrected{0};
  std::thread smoother([&] {
    for (; !stop; ++corrected) {
      const std::size_t pings = filter.snapshot().pings();
      const Pose2 east{kEast_m, 0.0, 0.0};
      filter.correctPast({{{0, east}, {pings - 1, east}}, east, {}});
      filter.resample({1, 0, 2, 2});
    }
  });
  for (int k = 20; k < 60 || read < 200 || corrected < 30; ++k) sail(filter, still, k, k + 1);
  stop = true;
  for (std::thread& reader : readers) reader.join();
  smoother.join();
  EXPECT_TRUE(sound);
}

}  // namespace
}  // namespace rbpf_core
