// Minibatches of the same beams for all particles.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "rbpf_core/particle_filter.hpp"
#include "statistics.hpp"
#include "survey.hpp"

namespace rbpf_core {
namespace {

// 100 pings of 8 beams, each at a depth of its own, which tells the beam's number in the log.
void sailAtDepths(ParticleFilter& filter) {
  for (int k = 0; k < 100; ++k) {
    filter.addOdometry(turning(k));
    Ping ping = pingAt(k);
    for (int i = 0; i < 8; ++i) {
      ping.beams_m(2, i) = -20.0F - 0.125F * static_cast<float>(8 * k + i);
    }
    filter.addPing(ping);
  }
}

std::vector<std::size_t> numbersOf(const std::vector<PlacedBeam>& batch) {
  std::vector<std::size_t> numbers;
  for (const PlacedBeam& beam : batch) {
    numbers.push_back(static_cast<std::size_t>(std::lround((-30.0F - beam.z_m) / 0.125F)));
  }
  return numbers;
}

FilterParams commonParams(std::size_t particles, std::uint64_t seed = 1) {
  FilterParams params = noisyParams(particles, seed);
  params.common_random_numbers = true;
  return params;
}

TEST(CommonRandomNumbers, DrawTheSameBeamsForAllParticlesInWhateverOrderTheyAsk) {
  ParticleFilter filter(commonParams(3));
  sailAtDepths(filter);
  std::vector<std::vector<std::vector<std::size_t>>> numbers(3);
  for (int call = 0; call < 5; ++call) numbers[2].push_back(numbersOf(drawFrom(filter, 2, 500)));
  for (int call = 0; call < 5; ++call) {
    for (const std::size_t j : {1U, 0U}) numbers[j].push_back(numbersOf(drawFrom(filter, j, 500)));
  }
  EXPECT_EQ(numbers[0], numbers[1]);
  EXPECT_EQ(numbers[0], numbers[2]);
}

TEST(CommonRandomNumbers, AreNotSharedUnlessAskedFor) {
  ParticleFilter filter(noisyParams(2));
  sailAtDepths(filter);
  EXPECT_NE(numbersOf(drawFrom(filter, 0, 500)), numbersOf(drawFrom(filter, 1, 500)));
}

TEST(CommonRandomNumbers, LeaveTheBeamsToEachParticlesOwnHistory) {
  ParticleFilter filter(commonParams(3));
  sailAtDepths(filter);
  EXPECT_FALSE(filter.snapshot().particles()[0] == filter.snapshot().particles()[1]);
  for (std::size_t j = 0; j < 3; ++j) {
    const std::vector<PlacedBeam> log = blockFrom(filter, j, 0, 800);
    const std::vector<PlacedBeam> batch = drawFrom(filter, j, 500);
    const std::vector<std::size_t> numbers = numbersOf(batch);
    for (std::size_t i = 0; i < batch.size(); ++i) EXPECT_EQ(batch[i], log[numbers[i]]);
  }
}

TEST(CommonRandomNumbers, DifferFromCallToCallAndFromSeedToSeed) {
  ParticleFilter filter(commonParams(2));
  ParticleFilter other(commonParams(2, 2));
  sailAtDepths(filter);
  sailAtDepths(other);
  const auto first = numbersOf(drawFrom(filter, 1, 500));
  EXPECT_NE(first, numbersOf(drawFrom(filter, 1, 500)));
  EXPECT_NE(first, numbersOf(drawFrom(other, 1, 500)));
}

TEST(CommonRandomNumbers, AreUniformOverBeams) {
  ParticleFilter filter(commonParams(2));
  sailAtDepths(filter);
  std::vector<std::size_t> counts(800, 0);
  for (int call = 0; call < 200; ++call) {
    for (const std::size_t number : numbersOf(drawFrom(filter, 1, 1000))) ++counts[number];
  }
  EXPECT_LT(chiSquare(counts), chiSquareLimit(counts.size()));
}

}  // namespace
}  // namespace rbpf_core
