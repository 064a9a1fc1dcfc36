#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <set>
#include <vector>

#include "rbpf_core/random.hpp"
#include "statistics.hpp"

namespace rbpf_core {
namespace {

TEST(RandomStream, GivesTheReferenceSequenceOfSplitMix64) {
  RandomStream stream(1234567);
  // from the authors' reference implementation, so that results are the same on every machine
  for (const std::uint64_t expected :
       {6457827717110365317ULL, 3203168211198807973ULL, 9817491932198370423ULL,
        4593380528125082431ULL, 16408922859458223821ULL}) {
    EXPECT_EQ(stream(), expected);
  }
}

TEST(RandomStream, BelowStaysBelowForEveryBound) {
  RandomStream stream(3);
  for (const std::uint64_t n : {1ULL, 2ULL, 3ULL, 1000ULL, (1ULL << 40) + 1ULL, ~0ULL}) {
    for (int i = 0; i < 1000; ++i) ASSERT_LT(stream.below(n), n);
  }
}

TEST(RandomStream, BelowIsUniform) {
  constexpr std::size_t kBins = 1000;
  RandomStream stream = makeStream(1, StreamPurpose::kMinibatch, 0);
  std::vector<std::size_t> counts(kBins, 0);
  for (int i = 0; i < 200000; ++i) ++counts[stream.below(kBins)];
  EXPECT_LT(chiSquare(counts), chiSquareLimit(kBins));
}

TEST(RandomStream, UniformHasTheMomentsOfTheUnitInterval) {
  constexpr int kDraws = 200000;
  RandomStream stream = makeStream(2, StreamPurpose::kResampling, 0);
  double sum = 0.0;
  double sum_of_squares = 0.0;
  for (int i = 0; i < kDraws; ++i) {
    const double u = stream.uniform();
    ASSERT_GE(u, 0.0);
    ASSERT_LT(u, 1.0);
    sum += u;
    sum_of_squares += u * u;
  }
  // E u = 1/2, var u = 1/12; E u^2 = 1/3, var u^2 = 4/45
  EXPECT_NEAR(sum / kDraws, 0.5, kStandardErrors * std::sqrt(1.0 / 12.0 / kDraws));
  EXPECT_NEAR(sum_of_squares / kDraws, 1.0 / 3.0, kStandardErrors * std::sqrt(4.0 / 45.0 / kDraws));
}

TEST(RandomStream, UniformStaysBelowOneForTheLargestDraw) {
  constexpr std::uint64_t kBeforeTheLargest = 0x31628AF67B2131ABULL;  // SplitMix64 run backwards
  ASSERT_EQ(RandomStream(kBeforeTheLargest)(), RandomStream::max());
  EXPECT_LT(RandomStream(kBeforeTheLargest).uniform(), 1.0);
  EXPECT_EQ(RandomStream(kBeforeTheLargest).below(1000), 999U);
}

TEST(MakeStream, IsAFunctionOfItsArgumentsAlone) {
  RandomStream a = makeStream(7, StreamPurpose::kMotion, 3, 9);
  makeStream(8, StreamPurpose::kMotion, 3, 9)();
  RandomStream b = makeStream(7, StreamPurpose::kMotion, 3, 9);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(a(), b());
}

TEST(MakeStream, DiffersInSeedPurposeParticleAndCall) {
  std::set<std::uint64_t> first_draws;
  std::size_t streams = 0;
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    for (const auto purpose : {StreamPurpose::kStart, StreamPurpose::kMotion,
                               StreamPurpose::kMinibatch, StreamPurpose::kResampling}) {
      for (std::uint64_t particle = 0; particle < 40; ++particle) {
        for (std::uint64_t call = 0; call < 25; ++call, ++streams) {
          first_draws.insert(makeStream(seed, purpose, particle, call)());
        }
      }
    }
  }
  EXPECT_EQ(first_draws.size(), streams);
}

// A minibatch opens a stream of its own: the draws must be as good across streams as within one.
TEST(MakeStream, IsUniformAcrossSuccessiveCalls) {
  constexpr std::size_t kBins = 500;
  std::vector<std::size_t> counts(kBins, 0);
  for (std::uint64_t call = 0; call < 100000; ++call) {
    ++counts[makeStream(1, StreamPurpose::kMinibatch, 4, call).below(kBins)];
  }
  EXPECT_LT(chiSquare(counts), chiSquareLimit(kBins));
}

TEST(MakeStream, GivesNeighbouringParticlesStreamsWithoutCorrelation) {
  constexpr int kDraws = 100000;
  for (std::uint64_t particle = 0; particle < 5; ++particle) {
    RandomStream a = makeStream(1, StreamPurpose::kMotion, particle);
    RandomStream b = makeStream(1, StreamPurpose::kMotion, particle + 1);
    double product = 0.0;
    for (int i = 0; i < kDraws; ++i) product += (a.uniform() - 0.5) * (b.uniform() - 0.5);
    // a correlation of independent draws has the standard error 1 / sqrt(n)
    EXPECT_NEAR(12.0 * product / kDraws, 0.0, kStandardErrors / std::sqrt(kDraws));
  }
}

}  // namespace
}  // namespace rbpf_core
