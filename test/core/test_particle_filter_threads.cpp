// The filter under many threads: a survey that grows and is resampled while others read it.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <thread>
#include <vector>

#include "rbpf_core/particle_filter.hpp"
#include "survey.hpp"

namespace rbpf_core {
namespace {

// The map nodes draw as fast as they can, all at once; the survey must not wait for them.
TEST(ParticleFilterThreads, TakeOdometryInWhileMinibatchesAreDrawnWithoutAPause) {
  using Clock = std::chrono::steady_clock;
  ParticleFilter filter(quietParams());
  sail(filter, turning, 0, 5);
  constexpr int kThreads = 6;
  std::atomic<bool> stop{false};
  std::atomic<int> drawing{0};
  const Clock::time_point start = Clock::now();
  const Clock::time_point deadline = start + std::chrono::seconds(10);  // of a test that fails
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&] {
      std::vector<PlacedBeam> batch(1000);
      ++drawing;
      while (!stop && Clock::now() < deadline)
        filter.snapshot().drawMinibatch(0, batch.size(), batch.data());
    });
  }
  while (drawing < kThreads) std::this_thread::yield();
  for (int k = 25; k < 125; ++k) filter.addOdometry(turning(0.2 * k));
  const std::chrono::duration<double> taken = Clock::now() - start;
  stop = true;
  for (std::thread& thread : threads) thread.join();
  // 20 s of odometry; with two cores for seven threads a message takes some time slices of 4 ms
  EXPECT_LT(taken.count(), 8.0);
}

// Meant for ThreadSanitizer too: everything that runs at once in the live node.
TEST(ParticleFilterThreads, DrawAndReadWhileTheSurveyGrowsAndIsResampled) {
  constexpr std::size_t kParticles = 8;
  ParticleFilter filter(noisyParams(kParticles));
  sail(filter, turning, 0, 5);
  std::atomic<bool> stop{false};
  std::atomic<bool> sound{true};
  std::atomic<std::size_t> drawn{0};
  std::vector<std::thread> threads;
  for (std::size_t t = 0; t < 3; ++t) {
    threads.emplace_back([&, t] {
      for (std::size_t call = t; !stop; ++call, ++drawn) {
        for (const PlacedBeam& beam : drawFrom(filter, call % kParticles, 50)) {
          // on a circle of 20 m radius, with noise; a beam from elsewhere is a torn read
          if (!(std::hypot(beam.x_m, beam.y_m) < 500.0F) || beam.z_m != -30.0F) sound = false;
        }
        const std::size_t last = filter.snapshot().beamsReleased() - 1;
        if (blockFrom(filter, call % kParticles, last, 1).front().z_m != -30.0F) sound = false;
      }
    });
  }
  threads.emplace_back([&] {
    while (!stop) {
      const auto ping = filter.snapshot().latestPing();
      if (!ping || ping->poses.size() != kParticles) sound = false;
      if (filter.snapshot().survey(0, 3).size() != 3) sound = false;
      if (filter.snapshot().estimate().covariance.diagonal().minCoeff() < 0.0) sound = false;
      filter.snapshot().counters();
    }
  });
  std::atomic<std::size_t> resampled{0};
  threads.emplace_back([&] {
    for (; !stop; ++resampled) {
      filter.setLogWeights(filter.snapshot().logWeights());
      filter.resample({0, 0, 1, 3, 3, 3, 6, 7});
      filter.resample({0, 1, 2, 3, 4, 5, 6, 7});
    }
  });
  for (int k = 5; k < 60 || drawn < 1000 || resampled < 30; ++k) sail(filter, turning, k, k + 1);
  stop = true;
  for (std::thread& thread : threads) thread.join();
  EXPECT_TRUE(sound);
  EXPECT_EQ(filter.snapshot().counters().pings_dropped, 0U);
}

// The most pings that came in while one call of `work` lasted, over up to 200 calls; no more calls
// once it is `enough`.
template <typename Work>
std::size_t pingsTakenInDuring(std::size_t enough, const Work& work) {
  ParticleFilter filter(noisyParams(8));
  sail(filter, turning, 0, 99);
  std::atomic<bool> stop{false};
  std::thread vehicle([&] {
    for (int k = 500; !stop; ++k) {
      filter.addOdometry(turning(0.2 * k));
      filter.addPing(pingAt(0.2 * k));
    }
  });
  std::size_t most = 0;
  for (int call = 0; call < 200 && most < enough; ++call) {
    const std::size_t before = filter.snapshot().pings();
    work(filter);
    most = std::max(most, filter.snapshot().pings() - before);
  }
  stop = true;
  vehicle.join();
  return most;
}

// Each call takes some milliseconds, a ping some microseconds. Under a common lock only those few
// pings would come in that slip in between the call's ends and the lock's.
TEST(ParticleFilterThreads, PingsAreTakenInWhileOthersAreAtWork) {
  constexpr std::size_t kEnough = 50;
  const auto reading = [](const ParticleFilter& filter) { filter.snapshot().survey(0, 1000000); };
  EXPECT_GE(pingsTakenInDuring(kEnough, reading), kEnough);
  std::vector<PlacedBeam> minibatch(1000000);
  const auto drawing = [&](const ParticleFilter& filter) {
    filter.snapshot().drawMinibatch(0, minibatch.size(), minibatch.data());
  };
  EXPECT_GE(pingsTakenInDuring(kEnough, drawing), kEnough);
}

// A published snapshot stays as it was: what a reader makes of it belongs together.
TEST(ParticleFilterSnapshot, StaysAsItWasWhileTheFilterGoesOn) {
  FilterParams params = noisyParams(5);
  params.common_random_numbers = true;
  ParticleFilter filter(params);
  sail(filter, turning, 0, 20);
  const FilterSnapshot before = filter.snapshot();
  const auto particles = before.particles();
  const auto survey = before.survey(0, 1000);
  const std::vector<PlacedBeam> log = placed(before.logBlock({3}, 0, before.beams()));

  sail(filter, turning, 20, 60);
  filter.setLogWeights(Eigen::ArrayXd::LinSpaced(5, -3.0, -1.0));
  filter.resample({4, 4, 4, 1, 1});
  sail(filter, turning, 60, 100);
  filter.finish();

  EXPECT_EQ(before.particles(), particles);
  EXPECT_TRUE((before.logWeights() == -std::log(5.0)).all());
  ASSERT_EQ(before.survey(0, 1000).size(), survey.size());
  for (std::size_t i = 0; i < survey.size(); ++i) {
    EXPECT_EQ(before.survey(i, 1)[0].estimate, survey[i].estimate);
  }
  EXPECT_EQ(placed(before.logBlock({3}, 0, before.beamsReleased())), log);
  EXPECT_EQ(before.beamsReleased(), log.size());
  EXPECT_GT(filter.snapshot().beamsReleased(), log.size());
  EXPECT_EQ(before.latestPing()->index, survey.size() - 1);
}

// Pings taken in while a resampling is being prepared belong to the ancestors' histories, as those
// before it do.
TEST(ParticleFilterSnapshot, HistoriesSurviveResamplingsAsTheyAreTakenIn) {
  constexpr std::size_t kParticles = 4;
  ParticleFilter filter(noisyParams(kParticles));
  std::atomic<bool> stop{false};
  std::thread resampling([&] {
    for (std::uint32_t k = 0; !stop; ++k) filter.resample({0, k % 4, 2, (k + 1) % 4});
  });
  sail(filter, turning, 0, 100);
  stop = true;
  resampling.join();
  // particles 0 and 2 always went on from themselves: their histories must be those without
  // resampling
  ParticleFilter alone(noisyParams(kParticles));
  sail(alone, turning, 0, 100);
  for (const std::size_t particle : {0U, 2U}) {
    EXPECT_EQ(blockFrom(filter, particle, 0, filter.snapshot().beams()),
              blockFrom(alone, particle, 0, alone.snapshot().beams()));
  }
}

}  // namespace
}  // namespace rbpf_core
